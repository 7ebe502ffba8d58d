"""Charts by matplotlib, which nothing outside this folder imports."""
