"""The default problem, in the platform's coordinates, and its interior-point method."""
