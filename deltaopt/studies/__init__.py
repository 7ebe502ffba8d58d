"""Comparisons over many solutions, each behind a command."""
