"""Cycles: legs that are planned apart, at prices under which they keep the motors cool together."""
