"""Colours of every figure, on paper and in the browser; they are those of Okabe and Ito."""

BLACK, BLUE, ORANGE, GREEN, PURPLE, SKY = "#1a1a1a", "#0072b2", "#d55e00", "#009e73", "#aa4499", "#56b4e9"
"""Colours that colour-blind readers distinguish."""
GREY = "#8c8c8c"
"""Colour of what stands behind."""
