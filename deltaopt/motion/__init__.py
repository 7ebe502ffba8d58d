"""Motions as functions of time: trajectories, extrema, and slowing them to their limits."""
