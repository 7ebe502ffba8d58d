"""Sweeps: many plans of one cell with other numbers in it, a row of a table each."""
