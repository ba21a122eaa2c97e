"""What a converged picture is drawn in: pieces of planes, and bands of them drawn by any number of threads.

A picture of any size is cut into pieces whose positions float32 holds finely enough; one that needs no cut has the same
bits as if there were no cutting.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace

import numpy as np

from wall.core.data import Float32, Rect
from wall.core.errors import ConfigError
from wall.geometry import outlines
from wall.geometry.cameras import PanelView
from wall.geometry.panels import Panel, Plane
from wall.roles.plan import Layout, Plan, first_event
from wall.sampling.progressive import ProgressiveSampler
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import TracerScene

FLOAT32_EXACT_PIXELS = 8192  # sub-pixel positions stay finer than 1/1024 pixel up to here
_SEEDS_APART = 0x9E3779B1  # odd, so that the seeds of 2^32 pieces all differ


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Piece:
    """A rectangle of the picture, at most FLOAT32_EXACT_PIXELS on an edge, as a display of its own."""

    panel: Panel  # its `screen` is where the piece is in the picture
    seed: int

    @property
    def rect(self) -> Rect:
        """Where it is in the picture."""
        (x, y), (width, height) = self.panel.screen, self.panel.pixels
        return Rect(x=x, y=y, width=width, height=height)


def pieces(panels: list[Panel], *, seed: int) -> list[Piece]:
    """Panels, cut where they are large. The first piece of each has the seed itself: whole panels stay as they are."""
    cut = []
    for panel in panels:
        width, height = panel.pixels
        corners = [
            (x, y) for y in range(0, height, FLOAT32_EXACT_PIXELS) for x in range(0, width, FLOAT32_EXACT_PIXELS)
        ]
        for k, (x, y) in enumerate(corners):
            pixels = (min(FLOAT32_EXACT_PIXELS, width - x), min(FLOAT32_EXACT_PIXELS, height - y))
            screen = (panel.screen[0] + x, panel.screen[1] + y)
            part = replace(panel, pixels=pixels, screen=screen)
            cut.append(Piece(panel=part, seed=(seed + k * _SEEDS_APART) & 0xFFFFFFFF))
    return cut


def whole(layout: Layout, size: tuple[int, int] | None, *, scale: float = 1.0) -> list[Panel]:
    """What is drawn: one panel that is the whole flat wall at the wanted size, or the panels themselves.

    size : width and height of the picture, pixels; it keeps the wall's height in view. None: the wall's own
    scale : times more pixels each way, without a `size`

    Raises ConfigError for a `size` of panels that stand at angles, or are seen from several eyes.
    """
    wall, found = layout.wall, outlines.whole(layout.wall)
    if found is None and size is not None:
        why = "are seen from several eyes" if wall.flat else "stand at angles"
        raise ConfigError(f"{layout.loaded.path}: --size needs a flat wall, and these panels {why}; leave it out")
    if found is None or (size is None and len(wall.faces) > 1):
        return [scaled(panel, scale) for panel in wall.panels]
    width, height = size or (max(1, round(scale * found.width)), max(1, round(scale * found.height)))
    per, own = found.height / height, found.plane
    left = found.width / 2 - per * width / 2
    plane = Plane(origin=own.origin + left * own.per_x, per_x=own.per_x * per, per_y=own.per_y * per)
    return [replace(wall.panels[0], pixels=(width, height), screen=(0, 0), plane=plane)]


def scaled(panel: Panel, scale: float) -> Panel:
    """The same lit area in `scale` times as many pixels each way, to whole pixels; so is its place on the screen."""
    if scale == 1.0:
        return panel
    (w, h), plane = panel.pixels, panel.plane
    width, height = max(1, round(scale * w)), max(1, round(scale * h))
    x, y = round(scale * panel.screen[0]), round(scale * panel.screen[1])
    per_x, per_y = plane.per_x * (w / width), plane.per_y * (h / height)
    origin = plane.point(*panel.screen) - x * per_x - y * per_y
    return replace(panel, pixels=(width, height), screen=(x, y), plane=Plane(origin=origin, per_x=per_x, per_y=per_y))


class Drawing:
    """Draws bands of pieces at one moment; threads may ask at once, each has a tracer of its own."""

    def __init__(self, plan: Plan, tracer_scene: TracerScene, *, spp: int, at: float) -> None:
        """`at` is the scene time, seconds; `spp` the samples of a pixel."""
        self._plan, self._tracer_scene, self._spp = plan, tracer_scene, spp
        self._event = replace(first_event(plan, 0.0), scene_time=at, camera=plan.view.camera_at(at))
        self._own = threading.local()

    def band(self, piece: Piece, rect: Rect) -> Float32:
        """(h, w, 3) float32 linear RGB of a rectangle in the piece's own pixels."""
        tracer, sampler = self._tracer(piece), ProgressiveSampler(rect, seed=piece.seed)
        for sample in range(self._spp):
            sampler.add(tracer.trace(sampler.positions(sample))[0])
        return sampler.mean().astype(np.float32)

    def _tracer(self, piece: Piece) -> Tracer:
        own = self._own
        if getattr(own, "piece", None) is piece:
            return own.tracer  # type: ignore[no-any-return]
        seen = PanelView(self._plan.view, piece.panel)
        if not hasattr(own, "tracer"):
            own.tracer = Tracer(self._tracer_scene, piece.panel, seen.eye, coherent=True)
        own.tracer.look_through(piece.panel, seen.eye, seen(self._event))
        own.piece = piece
        return own.tracer  # type: ignore[no-any-return]
