"""Studies that hold what the documentation claims; beside the package, not installed with it."""
