"""A plan as one page for a browser: the moving robot, its limits over time, its verification."""
