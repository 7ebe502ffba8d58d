"""Concrete mechanisms."""
