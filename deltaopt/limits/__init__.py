"""What a motion must keep: one file for each limit, and what is derived from all of them."""
