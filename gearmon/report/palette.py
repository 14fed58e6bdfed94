"""Colours that stay apart for colour-blind readers and in grey print.

References
----------
Okabe and Ito, Color Universal Design, 2008: eight colours told apart with any common colour vision.
"""

from __future__ import annotations

BLACK = "#1a1a1a"
GREY = "#8a8f98"
LIGHT_GREY = "#d5d8dd"
BLUE = "#0072B2"
SKY = "#56B4E9"
GREEN = "#009E73"
ORANGE = "#E69F00"
VERMILLION = "#D55E00"
PURPLE = "#B0508A"

# In the order in which stages, gears or channels take them.
SERIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")

#: Dashes of limits, nominal values and marks of lines.
DASHED = (0, (4, 2))

# Background, text and sign of each verdict: the sign and the word say it without the colour too.
VERDICT_STYLE = {
    "healthy": ("#00664B", "#ffffff", "✓"),
    "fault": ("#A63D00", "#ffffff", "!"),
    "no mesh found": ("#48525E", "#ffffff", "∅"),
    "cannot tell": ("#F2C84B", "#1a1a1a", "?"),
}


def series_colour(index: int) -> str:
    """Return the colour of the item with this index, from 0; colours repeat after eight."""
    return SERIES[index % len(SERIES)]


def series_marker(index: int) -> str:
    """Return the marker of the item with this index, from 0; markers repeat after eight."""
    return MARKERS[index % len(MARKERS)]
