"""How the duration of a plan, or the period of a cycle, depends on every number of its files."""
