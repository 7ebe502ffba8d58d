"""How fast and how reliable planning is, measured on this machine."""
