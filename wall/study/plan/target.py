"""The wall that is planned: a configuration's, one of a few numbers, or one of those in the texts.

Watson and Luebke, "The Ultimate Display: Where Will All the Pixels Come From?", IEEE Computer, August 2005, name
three: 50 displays "similar to the T221", 455 Mpixel at 200 dpi and 48 Hz; 670 Mpixel at 190 dpi, which "supports human
visual acuity during close-up viewing"; and "printer-resolution (600 dpi) wall displays updated at 240 Hz, requiring 7.2
gigapixels". It gives no sizes: they follow from pixels and dpi. Nor distances: see `READING_M`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.geometry.eyes import eye_of
from wall.geometry.panels import Panel
from wall.roles.plan import Plan

INCH_M = 0.0254
ASPECT = 16 / 9  # of a wall of which only the number of pixels is known
READING_M = 18 * INCH_M  # where a pixel of 190 dpi spans one minute of arc, so the article's "close-up viewing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A wall, as far as a budget needs it."""

    name: str
    pixels: float
    width_m: float
    height_m: float
    distance_m: float  # from the eye to the nearest pixel
    dpi: float  # where the eye is nearest
    refresh_hz: float
    panels: int
    source: str = ""

    @property
    def area_m2(self) -> float:
        """Lit area, square metres."""
        return self.width_m * self.height_m

    def __str__(self) -> str:
        return (
            f"{self.name}: {self.pixels / 1e6:,.1f} Mpixel, {self.width_m:.2f} x {self.height_m:.2f} m, "
            f"{self.dpi:.0f} dpi, {self.refresh_hz:g} Hz, seen from {self.distance_m:.2f} m"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says of a wall that has no configuration. None: it follows from the others."""

    pixels: float | None = None
    size: tuple[float, float] | None = None  # metres
    dpi: float | None = None
    hz: float = 60.0
    distance: float = READING_M  # metres
    panel: float = 3840.0 * 2160.0  # pixels of one panel


def of_numbers(given: Given) -> Target:
    """A wall of any two of pixels, size and dpi. Raises ConfigError for fewer, or three that contradict."""
    if sum(value is not None for value in (given.pixels, given.size, given.dpi)) < 2:
        raise ConfigError("wall plan: wanted a configuration, or two of --pixels, --size and --dpi")
    if given.pixels is None:
        assert given.size is not None
        assert given.dpi is not None
        pixels = given.size[0] * given.size[1] / (INCH_M / given.dpi) ** 2
    else:
        pixels = given.pixels
    if given.size is None:
        assert given.dpi is not None
        height = math.sqrt(pixels * (INCH_M / given.dpi) ** 2 / ASPECT)
        size = ASPECT * height, height
    else:
        size = given.size
    dpi = INCH_M * math.sqrt(pixels / (size[0] * size[1]))
    if given.dpi is not None and abs(dpi / given.dpi - 1.0) > 0.01:
        raise ConfigError(f"--dpi {given.dpi:g}: {pixels:g} pixels on {size[0]:g} x {size[1]:g} m have {dpi:.4g} dpi")
    return Target(
        name="wall", pixels=pixels, width_m=size[0], height_m=size[1], distance_m=given.distance, dpi=dpi,
        refresh_hz=given.hz, panels=math.ceil(pixels / given.panel),
    )  # fmt: skip


def of_plan(plan: Plan) -> Target:
    """A configuration's wall, as its first view's eye sees it."""
    wall, view = plan.layout.wall, plan.view
    separation = plan.layout.config.views[0].eye_separation
    width, height = wall.extent
    found = []
    for panel in wall.panels:
        eye = eye_of(panel, np.asarray(view.eye), separation)
        found.append((_distance(panel, eye), max(panel.pitch)))
    distance, pitch = min(found, key=lambda pair: pair[0] / pair[1])  # whose pixels look largest
    return Target(
        name=plan.layout.loaded.path.stem, pixels=float(sum(p.pixels[0] * p.pixels[1] for p in wall.panels)),
        width_m=width, height_m=height, distance_m=distance, dpi=INCH_M / pitch,
        refresh_hz=view.refresh_hz, panels=len(wall.panels), source=str(plan.layout.loaded.path),
    )  # fmt: skip


def _distance(panel: Panel, eye: Float64) -> float:
    """Metres from an eye to the nearest point of a panel."""
    corner, across, up = panel.corners[0], panel.corners[1] - panel.corners[0], panel.corners[2] - panel.corners[0]
    offset = eye - corner
    x, y = (float(np.clip(offset @ edge / (edge @ edge), 0.0, 1.0)) for edge in (across, up))
    return float(np.linalg.norm(offset - x * across - y * up))


def _named(name: str, pixels: float, dpi: float, hz: float, panels: int, words: str) -> Target:
    found = of_numbers(Given(pixels=pixels, dpi=dpi, hz=hz))
    return Target(
        name=name, pixels=pixels, width_m=found.width_m, height_m=found.height_m, distance_m=READING_M, dpi=dpi,
        refresh_hz=hz, panels=panels, source=f"Watson and Luebke 2005: {words}",
    )  # fmt: skip


TEXTS = (
    _named("T221 array", 455e6, 200, 48, 50, "50 displays similar to the T221, 455 megapixels at 200 dpi and 48 Hz"),
    _named("visual acuity", 670e6, 190, 60, 100, "670 megapixels with 190 dpi; no rate is named, 60 Hz is assumed"),
    _named("printer resolution", 7.2e9, 600, 240, 500, "600 dpi at 240 Hz, 7.2 gigapixels"),
)
