"""First motions, from which planning starts: simple ones, over a grid, through passages."""
