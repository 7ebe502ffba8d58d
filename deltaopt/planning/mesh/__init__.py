"""Solutions on a mesh: their error estimate, and what the next mesh should be."""
