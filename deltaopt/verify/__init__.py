"""Verification of a motion by means that its planner did not use."""
