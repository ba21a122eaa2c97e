"""A wall with no more pixels than this machine's cores keep in motion, for `wall run --fit` and the demo."""

from __future__ import annotations

import math

from wall.config.loading import Loaded

STEP = 8  # pixels; sizes of panels are multiples of it
LEAST = 64  # pixels of a panel's side


def fitted(loaded: Loaded, cores: int) -> tuple[Loaded, str]:
    """The same wall, its panels of fewer pixels if they are more than the cores; and what was done, "" for nothing.

    A core each is what panels were made for: their pixels are as many fewer as cores are. Panels of a grid alone.
    """
    grid = loaded.config.wall.grid
    panels = 0 if grid is None else grid.columns * grid.rows
    if grid is None or panels <= cores:
        return loaded, ""
    scale = math.sqrt(cores / panels)
    across, down = (max(min(n, LEAST), STEP * round(scale * n / STEP)) for n in grid.pixels)
    smaller = loaded.config.wall.model_copy(update={"grid": grid.model_copy(update={"pixels": (across, down)})})
    said = (
        f"{cores} cores for {panels} panels: each has {across}x{down} pixels, not {grid.pixels[0]}x{grid.pixels[1]}; "
        "--config FILE runs a wall as it is"
    )
    return loaded.with_config(loaded.config.model_copy(update={"wall": smaller})), said
