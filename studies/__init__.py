"""Studies of deltaopt: campaigns and comparisons that are run from a clone, not installed."""
