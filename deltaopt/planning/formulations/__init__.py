"""Formulations in other coordinates and with other forms of the dynamics, solved by Ipopt."""
