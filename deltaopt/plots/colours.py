"""Colours of charts and pages, which the colour-blind can distinguish."""

COLOURS = ("#0072B2", "#D55E00", "#009E73")
"""Blue, vermilion and green of Okabe and Ito, for motors 1 to 3 or axes x, y, z."""
OF_LIMITS = ("#56B4E9", "#E69F00", "#CC79A7", "#F0E442")
"""Sky blue, orange, purple and yellow of Okabe and Ito, for limits in the order of a scene's."""
