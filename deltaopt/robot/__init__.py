"""Robots: their files, and the kinematics and dynamics of a robot with a payload."""
