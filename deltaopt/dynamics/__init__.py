"""The mechanics of sections 2 and 3 for any mechanism."""
