"""Colours of charts and pages, which the colour-blind can distinguish: Okabe and Ito's."""

BLUE, VERMILION, GREEN = "#0072B2", "#D55E00", "#009E73"
SKY_BLUE, ORANGE, PURPLE, YELLOW = "#56B4E9", "#E69F00", "#CC79A7", "#F0E442"
BLACK, GREY, LIGHT_GREY = "#000000", "#737373", "#CCCCCC"
LIGHT_BLUE = "#A6D5F2"
COLOURS = (BLUE, VERMILION, GREEN)
"""For motors 1 to 3 or axes x, y, z."""
OF_LIMITS = (SKY_BLUE, ORANGE, PURPLE, YELLOW)
"""For limits in the order of a scene's."""
LINE_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY_BLUE, BLACK, GREY)
"""For lines that are named where they end."""
