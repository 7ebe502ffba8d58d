"""What is to be moved, from where to where, within which limits, for which objective."""
