"""Formulations of the dynamics, and of plans, compared in accuracy and cost."""
