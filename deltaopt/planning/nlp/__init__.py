"""Nonlinear programs: variables, transcription, scaling, and their solution by Ipopt."""
