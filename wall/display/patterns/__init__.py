"""Test patterns: is every panel where the wall thinks it is, its pixels whole, its greys right?

Pure: a panel of a wall in, its image out. Lines are drawn in metres of the unfolded wall (unfolding.py), so that they
run on from panel to panel exactly if the panels stand where the configuration says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from wall.display.patterns.gamma import gamma
from wall.display.patterns.grid import grid
from wall.display.patterns.identify import identify
from wall.display.patterns.seam import seam
from wall.display.patterns.unfolding import unfold
from wall.geometry.panels import Panel, Wall

Kind: TypeAlias = Literal["identify", "grid", "seam", "gamma"]
KINDS: tuple[Kind, ...] = get_args(Kind)


def pattern(kind: Kind, panel: Panel, wall: Wall, about: Sequence[tuple[str, str]] = ()) -> NDArray[np.uint8]:
    """(h, w, 3) uint8 sRGB, the image of a panel of a wall.

    identify: which panel this is, its corners, and `about` it, rows of a name and a text, such as ("host", "node3")
    grid: lines of one pixel a round number of metres apart, the panel's outermost pixels, and circles and diagonals
        over the whole wall: round, and unbroken at the seams, where all is right
    seam: hairlines that cross every seam, in colours that tell which goes on as which
    gamma: ramps beside dithered greys, which look the same from afar where the display is sRGB
    """
    if kind == "gamma":
        return gamma(*panel.pixels)
    unfolded = unfold(panel, wall)
    if kind == "grid":
        return grid(panel, unfolded)
    return seam(panel, unfolded) if kind == "seam" else identify(panel, unfolded, about)
