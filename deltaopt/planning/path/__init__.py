"""Planning on a given path: one coordinate, its squared speed swept back and forth."""
