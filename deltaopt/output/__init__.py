"""Plans as files, and a robot's dynamics as C."""
