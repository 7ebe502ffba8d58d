"""The same problem in other coordinates and with other forms of the dynamics, for Ipopt."""
