"""Charts. Nothing outside this folder imports matplotlib."""
