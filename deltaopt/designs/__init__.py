"""Designs: which lengths, gears and motors make scenes fastest, or cheapest."""
