"""A wall with no more pixels than this machine's cores keep in motion, for `wall run --fit` and the demo."""

from __future__ import annotations

import math

from wall.config.loading import Loaded

STEP = 8  # pixels; widths of panels are multiples of it
LEAST = 64  # pixels of a panel's side


def fitted(loaded: Loaded, cores: int) -> tuple[Loaded, str]:
    """The same wall, its panels of fewer pixels if they are more than the cores; and what was done, "" for nothing.

    A core each is what panels were made for: their pixels are as many fewer as cores are. Panels of a grid alone.
    """
    grid = loaded.config.wall.grid
    panels = 0 if grid is None else grid.columns * grid.rows
    if grid is None or panels <= cores:
        return loaded, ""
    across, down = _fewer(grid.pixels, cores / panels)
    said = (
        f"{cores} cores for {panels} panels: each has {across}x{down} pixels, not {grid.pixels[0]}x{grid.pixels[1]}; "
        "wall run CONFIG runs a wall as it is"
    )
    return with_share(loaded, cores / panels), said


def _fewer(pixels: tuple[int, int], share: float) -> tuple[int, int]:
    """A panel's pixels across and down, of which a share is left, in the same shape: square ones stay square."""
    across = min(pixels[0], max(LEAST, STEP * round(math.sqrt(share) * pixels[0] / STEP)))
    down = min(pixels[1], max(LEAST, round(pixels[1] * across / pixels[0])))
    return across, down


def with_share(loaded: Loaded, share: float) -> Loaded:
    """The same wall, each of its panels with a share of its pixels."""
    wall = loaded.config.wall
    grid = wall.grid.model_copy(update={"pixels": _fewer(wall.grid.pixels, share)}) if wall.grid is not None else None
    panels = tuple(p.model_copy(update={"pixels": _fewer(p.pixels, share)}) for p in wall.panels or ()) or None
    smaller = wall.model_copy(update={"grid": grid, "panels": panels})
    return loaded.with_config(loaded.config.model_copy(update={"wall": smaller}))
