"""Panels in the wall's frame (metres) and in the virtual screen (pixels).

Wall frame: x right, y up, z towards the viewer; a grid has its centre at the origin. Virtual screen: x right,
y down, origin at the top left of all panels, bezel gaps and overlaps included as whole pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wall.config.displays import BlendConfig, SidesConfig
from wall.config.screens import PanelConfig
from wall.core.data import Float64
from wall.geometry.plane import Plane as Plane
from wall.geometry.scan import Scan
from wall.geometry.surfaces import Surface

NO_VIEW = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """One display, for one eye. Panels that lie in one plane on one grid of pixels share one Plane object.

    So their rays are those of the whole wall, bit for bit.
    """

    config: PanelConfig  # of this eye alone
    id: str
    index: int  # in Wall.panels
    pixels: tuple[int, int]  # width, height, as the viewer sees it
    plane: Plane
    screen: tuple[int, int] = (0, 0)  # where its top left pixel is in the virtual screen
    span: tuple[int, int] = (0, 0)  # width and height there: its pixels, or more where others of its face are finer
    shift: float = 0.0  # of the eye to the wall frame's right, eye separations: -0.5 left, 0.5 right
    of: str = ""  # id of the physical panel; its own unless the physical one holds both eyes in one image
    at: tuple[int, int] = (0, 0)  # its top left pixel in the physical panel's image
    skip: bool = False  # its pixels span its bezels too, squeezed into the lit area
    blend: BlendConfig | None = None  # metres; `auto` is worked out
    view: int = 0  # index in Config.views: what it shows, but for insets; NO_VIEW: these cover all of it
    scan: Scan | None = None  # when its display lights it; None: all rows at once
    inset_of: int | None = None  # an inset: index of the panel whose pixels it covers with another view
    surface: Surface | None = None  # where its pixels are if it is curved: its plane then is of the flat image alone

    @property
    def on_panel(self) -> int:
        """Index of the panel that it is, or of which it is an inset."""
        return self.index if self.inset_of is None else self.inset_of

    @property
    def corners(self) -> Float64:
        """(3, 3) rows lower left, lower right, upper left of what the pixels span; metres, wall frame."""
        (x, y), (w, h) = self.screen, self.pixels
        return np.array([self.plane.point(x, y + h), self.plane.point(x + w, y + h), self.plane.point(x, y)])

    @property
    def pitch(self) -> tuple[float, float]:
        """Metres a pixel, across and down."""
        return float(np.linalg.norm(self.plane.per_x)), float(np.linalg.norm(self.plane.per_y))

    @property
    def lit_pitch(self) -> tuple[float, float]:
        """Metres a pixel of what shines, across and down: along the surface of a curved panel."""
        return self.pitch if self.surface is None else self.surface.pitch

    @property
    def lit(self) -> Float64:
        """(3, 3) float64, as `corners`, of what shines: without bezels where its pixels span them."""
        return widened(self.corners, self.config.bezel, -1.0) if self.skip else self.corners

    @property
    def scan_s(self) -> float:
        """Seconds from its first row to the end of its last one; 0 where all are shown at once."""
        width, height = self.pixels
        return 0.0 if self.scan is None else abs(self.scan.per_x) * width + abs(self.scan.per_y) * height

    @property
    def sight(self) -> tuple[float, tuple[float, float, float] | None]:
        """Who looks at it: shift in eye separations, own eye."""
        return self.shift, self.config.eye


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlap:
    """A rectangle that two panels of one face light for the same eye."""

    first: int  # index in Wall.panels, the smaller
    second: int
    size: tuple[float, float]  # metres
    declared: tuple[float, float]  # metres side by side and above each other that both panels say, where they meet
    allowed: bool  # it is no larger than declared, side by side or above each other


class Whole(NamedTuple):
    """A flat wall as one image."""

    plane: Plane
    width: int  # pixels
    height: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wall:
    """All panels, and the size of the virtual screen in pixels."""

    panels: tuple[Panel, ...]
    width: int
    height: int
    faces: tuple[tuple[int, ...], ...] = ()  # indices of panels that lie in the virtual screen as they stand
    overlaps: tuple[Overlap, ...] = ()  # what two panels light for the same eye, declared or not
    insets: tuple[Panel, ...] = ()  # parts of panels that show another view than the panel, the nearest last
    of_layers: tuple[Panel, ...] = ()  # in place of a viewport, for one layer alone: mostly with fewer pixels

    @property
    def viewports(self) -> tuple[Panel, ...]:
        """All that shows a view, at their indices: the panels, then the insets."""
        return self.panels + self.insets

    @property
    def traced(self) -> tuple[Panel, ...]:
        """All that samples are traced for, at their indices: the viewports, then the panels of single layers."""
        return self.viewports + self.of_layers

    def scanned(self, view: int) -> Panel | None:
        """The first panel or inset of a view that is not lit all at once; None if there is none."""
        return next((panel for panel in self.viewports if panel.view == view and panel.scan is not None), None)

    def of_view(self, view: int) -> Wall:
        """What shows a view, as a wall by itself: its panels, or its insets."""
        return replace(self, panels=tuple(p for p in self.viewports if p.view == view), insets=(), of_layers=())

    @property
    def extent(self) -> tuple[float, float]:
        """Metres across and down over all that is lit, gaps between panels with it.

        Of a wall that is not flat the height, and the area over the height that is lit: its mean width, overlaps once.
        """
        corners = [panel.lit for panel in self.panels]
        if self.flat:
            points = np.concatenate([np.vstack([c, c[1] + c[2] - c[0]]) for c in corners])
            plane = self.panels[0].plane
            across, down = (float(np.ptp(points @ axis) / np.linalg.norm(axis)) for axis in (plane.per_x, plane.per_y))
            return across, down
        area = sum(float(np.linalg.norm(np.cross(c[1] - c[0], c[2] - c[0]))) for c in corners)
        area -= sum(overlap.size[0] * overlap.size[1] for overlap in self.overlaps)
        heights = [[*c[:, 1], c[1, 1] + c[2, 1] - c[0, 1]] for c in corners]
        lit, top = 0.0, -math.inf
        for low, high in sorted((min(h), max(h)) for h in heights):
            lit, top = lit + max(0.0, high - max(low, top)), max(top, high)
        return float(area / max(lit, 1e-9)), float(np.ptp(heights))

    @property
    def flat(self) -> bool:
        """Whether all panels lie in one plane (to a millionth of the wall's size) and face the same way."""
        if any(panel.surface is not None for panel in self.panels):
            return False
        normal = self.panels[0].plane.normal
        corners = np.concatenate([panel.corners for panel in self.panels]) - self.panels[0].corners[0]
        size = float(np.abs(corners).max())
        same_way = all(panel.plane.normal @ normal > 1 - 1e-6 for panel in self.panels)
        return same_way and float(np.abs(corners @ normal).max()) <= 1e-6 * size

    @property
    def outline(self) -> Float64:
        """(3, 3) lower left, lower right, upper left of the rectangle around a flat wall; metres, wall frame."""
        first, start = self.panels[0].plane, self.panels[0].corners[0]
        right = first.per_x / np.linalg.norm(first.per_x)
        up = np.cross(first.normal, right)
        corners = np.array([panel.corners for panel in self.panels])
        around = np.concatenate([*corners.swapaxes(0, 1), corners[:, 1] + corners[:, 2] - corners[:, 0]])
        x, y = (around - start) @ right, (around - start) @ up
        low, high = start + y.min() * up, start + y.max() * up
        return np.array([low + x.min() * right, low + x.max() * right, high + x.min() * right])

    def window_ahead(self, eye: Float64) -> Float64:
        """(3, 3) lower left, lower right, upper left of what the eye looks through; metres, wall frame.

        All of a flat wall; of another the panel nearest to straight ahead (-z of the wall's frame).
        """
        return self.windows_ahead(eye)[0]

    def windows_ahead(self, eye: Float64) -> list[Float64]:
        """(3, 3) each as of `window_ahead`, that one first, then panels that are about as near to straight ahead.

        Their middles are further from it by less than a third of the angle that the first one is wide.
        """
        if self.flat:
            return [self.outline]
        corners = np.array([panel.corners for panel in self.panels]) - eye
        middles = (corners[:, 1] + corners[:, 2]) / 2
        away = np.arccos(np.clip(-middles[:, 2] / np.linalg.norm(middles, axis=1), -1.0, 1.0))
        order = np.argsort(away, kind="stable")
        left, right = corners[order[0], :2] / np.linalg.norm(corners[order[0], :2], axis=1, keepdims=True)
        most = away[order[0]] + np.arccos(np.clip(left @ right, -1.0, 1.0)) / 3
        return [self.panels[k].corners for k in order if away[k] <= most]

    def whole(self) -> Whole | None:
        """The wall as one image, as finely as its finest panel; None if it is not flat, or is seen from several eyes.

        Where all panels share a plane it is theirs, and its pixels are those of the virtual screen.
        """
        first = self.panels[0].plane
        if len({panel.sight for panel in self.panels}) > 1 or not self.flat:
            return None
        if all(panel.plane is first for panel in self.panels):
            return Whole(first, self.width, self.height)
        corners = self.outline
        sides = corners[1] - corners[0], corners[0] - corners[2]
        pitch = np.min([panel.pitch for panel in self.panels], axis=0)
        width, height = (max(1, round(float(np.linalg.norm(v)) / p)) for v, p in zip(sides, pitch, strict=True))
        return Whole(Plane(origin=corners[2], per_x=sides[0] / width, per_y=sides[1] / height), width, height)

    def panel(self, panel_id: str) -> Panel:
        """The panel or the inset of that id; KeyError if there is none."""
        for panel in self.viewports:
            if panel.id == panel_id:
                return panel
        raise KeyError(panel_id)


def of_fewer_pixels(panel: Panel, scale: float) -> Panel:
    """The same panel, corners and all, with so many of its pixels in each direction: one at least.

    It has a virtual screen of its own, whose top left pixel is its own. At scale 1 it is `panel` itself.
    """
    if scale == 1.0:
        return panel
    width, height = (max(1, round(scale * pixels)) for pixels in panel.pixels)
    across, down = panel.pixels[0] / width, panel.pixels[1] / height
    plane = Plane(
        origin=panel.plane.point(*panel.screen), per_x=panel.plane.per_x * across, per_y=panel.plane.per_y * down
    )
    scan = panel.scan and replace(panel.scan, per_x=panel.scan.per_x * across, per_y=panel.scan.per_y * down)
    return replace(panel, pixels=(width, height), plane=plane, screen=(0, 0), span=(width, height), scan=scan)


def widened(corners: Float64, frame: SidesConfig, times: float) -> Float64:
    """(3, 3) corners (rows as Panel.corners) of a rectangle made larger by a frame; -1 times the frame: smaller."""
    right, up = corners[1] - corners[0], corners[2] - corners[0]
    right, up = times * right / np.linalg.norm(right), times * up / np.linalg.norm(up)
    outwards = [(-frame.left, -frame.bottom), (frame.right, -frame.bottom), (-frame.left, frame.top)]
    wider: Float64 = corners + np.array([x * right + y * up for x, y in outwards])
    return wider
