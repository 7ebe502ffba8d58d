"""Requests to stop, such as Ctrl-C: heeded at any time, and without leaving anything half done."""
