"""Output: plans as files, and a robot's kinematics and dynamics as C."""
