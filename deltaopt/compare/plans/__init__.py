"""Ways to write the planning problem: what accuracy costs in each."""
