"""Scenes: robot, payload, start, goal, limits and objective, and whether they are feasible."""
