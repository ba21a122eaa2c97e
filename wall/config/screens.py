"""Models of `wall:`: panels in metres and pixels, as a regular grid or one by one."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le
from pydantic import BeforeValidator, Field, model_validator

from wall.config.displays import (
    Blend,
    BlendConfig,
    ColourConfig,
    Monitor,
    Pixels,
    RowTime,
    Sides,
    SidesConfig,
    Warp,
    Width,
    WindowConfig,
    is_number,
)
from wall.config.surfaces import SurfaceConfig
from wall.core.fields import NAME_PATTERN, Model, Name, Number, Point, RefreshRate, Text, Whole, refusal

MAX_PANELS = 1024
SQUARENESS = 0.01  # cosine of the corner angle: half a degree off is a typing error, not a panel
LONGEST_ID = 64
SHORTEST_M = 1e-4
ROUNDED = 1.0 + 1e-6  # widths and corners that were worked out are not exact

Metres = Annotated[Number, Ge(SHORTEST_M), Le(1e4)]
Rotation = Literal[0, 90, 180, 270]
Stereo = Literal["mono", "left", "right", "side_by_side", "top_bottom"]
PACKED = ("side_by_side", "top_bottom")
BEZEL = "dark frame, metres: one number or four sides"
ROTATION = "degrees, clockwise, that the display is mounted turned; what is sent to it is turned back"
STEREO = (
    "the eye that sees the panel, or both in one image: side_by_side, top_bottom make two panels, ID.left, ID.right"
)
ROW_TIME = (
    "seconds from the light of one row of the display to that of the next, from its top row down: each row is made for "
    "its own moment; 0 = all rows at once"
)
BLEND = "ramps where neighbours light the same area: none, auto (as wide as the overlap), or metres at each side"


def _check_sides(what: str, sides: SidesConfig, size: tuple[float, float]) -> None:
    """Refuse frames, overlaps and ramps that are wider than the panel itself."""
    if max(sides.left, sides.right) > size[0] * ROUNDED or max(sides.top, sides.bottom) > size[1] * ROUNDED:
        most = f"at most {size[0]:g} m at the sides, {size[1]:g} m above and below"
        raise refusal("is wider than the panel itself", accepted=most, at=(what,))


def _check_packing(stereo: Stereo, pixels: tuple[int, int], rotation: Rotation) -> None:
    """Refuse a display that cannot be halved for two eyes."""
    if stereo not in PACKED:
        return
    axis = 0 if stereo == "side_by_side" else 1
    if pixels[axis] % 2:
        accepted = f"an even {'height' if axis else 'width'} for stereo: {stereo}"
        raise refusal("cannot be halved for two eyes", accepted=accepted, at=("pixels", axis))
    if rotation:
        raise refusal(
            "a turned display cannot hold both eyes",
            accepted=f"0, or stereo: mono, left or right instead of {stereo}",
            at=("rotation",),
        )


def _twice(value: Any) -> Any:
    return [value, value] if is_number(value) else value


Overlaps = Annotated[tuple[Width, Width], BeforeValidator(_twice, json_schema_input_type=Width | tuple[Width, Width])]


class GridConfig(Model):
    """Equal panels in rows and columns, all in one plane, its centre at the origin of the wall's frame."""

    columns: Annotated[Whole, Ge(1), Le(256)] = Field(description="panels side by side")
    rows: Annotated[Whole, Ge(1), Le(256)] = Field(description="panels on top of each other")
    pixels: tuple[Pixels, Pixels] = Field(description="width and height of one panel as the viewer sees it, pixels")
    size: tuple[Metres, Metres] = Field(description="width and height of one panel's lit area, metres")
    bezel: Sides = Field(default=SidesConfig(), description=BEZEL)
    overlap: Overlaps = Field(
        default=(0.0, 0.0),
        description="metres that neighbours light together: side by side and above; one number: both",
    )
    id: Annotated[Text, Field(max_length=LONGEST_ID)] = Field(
        default="r{row}c{column}", description="pattern of the panels' ids; row 0 is the top one"
    )
    rotation: Rotation = Field(default=0, description=ROTATION)
    stereo: Stereo = Field(default="mono", description=STEREO)
    colour: ColourConfig | None = Field(default=None, description="what every panel does to its image")
    blend: Blend = Field(default="none", description=BLEND + ", between neighbours")
    host: Text | None = Field(default=None, description="machine of a panel, may hold {row} and {column}; absent = any")
    display: Text | None = Field(default=None, description="X display of a panel, may hold {row} and {column}")
    monitor: Monitor | None = Field(
        default=None, description="monitor of a panel: index, or name, which may hold {row} and {column}"
    )
    refresh_hz: RefreshRate | None = Field(default=None, description="images a second; absent = the view's")
    row_time: RowTime = Field(default=0.0, description=ROW_TIME)

    @model_validator(mode="after")
    def _panels_fit(self) -> GridConfig:
        _check_sides("bezel", self.bezel, self.size)
        _check_packing(self.stereo, self.pixels, self.rotation)
        if isinstance(self.blend, BlendConfig):
            _check_sides("blend", self.blend, self.size)
        if any(overlap > size / 2 for overlap, size in zip(self.overlap, self.size, strict=True)):
            most = f"at most {self.size[0] / 2:g} m side by side, {self.size[1] / 2:g} m above each other"
            raise refusal("is wider than half a panel", accepted=most, at=("overlap",))
        if (self.overlap[0] and self.bezel.across) or (self.overlap[1] and self.bezel.down):
            what = "panels with a frame between them cannot light the same area"
            raise refusal(what, accepted="one of bezel, overlap", at=("overlap",))
        return self

    @model_validator(mode="after")
    def _ids_differ(self) -> GridConfig:
        packed = self.stereo in PACKED
        if self.columns * self.rows * (1 + packed) > MAX_PANELS:
            what = f"{self.columns} x {self.rows} panels{' for two eyes' * packed} are too many"
            raise refusal(what, accepted=f"at most {MAX_PANELS}")
        ids = {self.panel_id(row, column) for row in range(self.rows) for column in range(self.columns)}
        if len(ids) < self.columns * self.rows:
            raise refusal("gives two panels the same id", accepted="text with {row} and {column}", at=("id",))
        names = {i: i + ".right" * packed for i in sorted(ids)}
        if bad := next((i for i, n in names.items() if len(n) > LONGEST_ID or not re.fullmatch(NAME_PATTERN, n)), None):
            raise refusal(f"gives the id {bad!r}", accepted="letters, digits, '.', '_' and '-'", at=("id",))
        return self

    def panel_id(self, row: int, column: int) -> str:
        """Returns the id of the panel at `row` and `column`, with the pattern's fields filled in."""
        return self.filled(self.id, row, column)

    @staticmethod
    def filled(pattern: str, row: int, column: int) -> str:
        """A pattern's text for one panel."""
        return pattern.replace("{row}", str(row)).replace("{column}", str(column))


class CornersConfig(Model):
    """Three corners of one panel's lit area as its viewer sees it; the fourth follows."""

    lower_left: Point = Field(description="metres, wall frame: x right, y up, z towards the viewer")
    lower_right: Point = Field(description="metres, wall frame")
    upper_left: Point = Field(description="metres, wall frame")

    @model_validator(mode="after")
    def _is_rectangle(self) -> CornersConfig:
        right = [b - a for a, b in zip(self.lower_left, self.lower_right, strict=True)]
        up = [b - a for a, b in zip(self.lower_left, self.upper_left, strict=True)]
        width, height = math.hypot(*right), math.hypot(*up)
        if min(width, height) * ROUNDED < SHORTEST_M:
            raise refusal(f"span {width:g} x {height:g} m", accepted=f"at least {SHORTEST_M:g} m each way")
        cosine = sum(a * b for a, b in zip(right, up, strict=True)) / (width * height)
        if abs(cosine) > SQUARENESS:
            angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
            raise refusal(f"meet at {angle:.1f} degrees", accepted="a right angle at lower_left")
        return self


class PanelConfig(Model):
    """One panel, wherever it stands."""

    id: Name = Field(description="letters, digits, '.', '_' and '-'; used in file names")
    pixels: tuple[Pixels, Pixels] = Field(
        description="as the viewer sees it: from lower_left to lower_right, and up to upper_left"
    )
    corners: CornersConfig | None = Field(default=None, description="where the lit area is, if it is flat")
    surface: SurfaceConfig | None = Field(default=None, description="which part of a curved screen it lights instead")
    bezel: Sides = Field(default=SidesConfig(), description=BEZEL)
    overlap: Sides = Field(
        default=SidesConfig(), description="metres of the lit area that neighbours light too: one number or four sides"
    )
    rotation: Rotation = Field(default=0, description=ROTATION)
    eye: Point | None = Field(default=None, description="who looks at this panel, metres, instead of the view's eye")
    stereo: Stereo = Field(default="mono", description=STEREO)
    colour: ColourConfig | None = Field(default=None, description="what the panel does to its image")
    blend: Blend = Field(default="none", description=BLEND)
    warp: Warp | None = Field(default=None, description="where the image goes on the display: nodes, or a file")
    blend_mask: Text | None = Field(
        default=None, description="PNG beside this file, as large as the display: its values, times those of the image"
    )
    host: Text | None = Field(default=None, description="machine the panel hangs on; absent = any")
    display: Text | None = Field(default=None, description="X display such as ':0.1'; absent = the host's own")
    monitor: Monitor | None = Field(
        default=None, description="index from 0, or name such as HDMI-1; absent = the first"
    )
    window: WindowConfig | None = Field(default=None, description="part of the monitor; absent = all of it")
    refresh_hz: RefreshRate | None = Field(default=None, description="images a second; absent = the view's")
    row_time: RowTime = Field(default=0.0, description=ROW_TIME)

    @model_validator(mode="after")
    def _sides_are_thin(self) -> PanelConfig:
        if (self.corners is None) == (self.surface is None):
            came = "has neither corners nor a surface" if self.corners is None else "has both corners and a surface"
            raise refusal(came, accepted="exactly one of corners, surface")
        size = self._size()
        _check_sides("bezel", self.bezel, size)
        _check_sides("overlap", self.overlap, size)
        if isinstance(self.blend, BlendConfig):
            _check_sides("blend", self.blend, size)
        _check_packing(self.stereo, self.pixels, self.rotation)
        alike = len(set(self.overlap.model_dump().values())) == 1  # perhaps written as one number
        for side in SidesConfig.model_fields:
            if getattr(self.bezel, side) and getattr(self.overlap, side):
                raise refusal(
                    "neighbours cannot light what a frame hides",
                    accepted=f"bezel or overlap at the {side}",
                    at=("overlap",) if alike else ("overlap", side),
                )
        return self

    @model_validator(mode="after")
    def _curved_is_plain(self) -> PanelConfig:
        if self.surface is not None:
            if self.bezel.across or self.bezel.down:
                raise refusal("a curved panel has no frame", accepted="a gap to its neighbours", at=("bezel",))
            if self.row_time:
                why = "rows of a curved panel are not rows of the flat image that is made for it"
                raise refusal(why, accepted="no row_time", at=("row_time",))
        return self

    def _size(self) -> tuple[float, float]:
        """Width and height of the lit area, metres; of a curved one along the surface, where it is largest."""
        if self.surface is not None:
            return self.surface.size
        assert self.corners is not None
        low, right, high = self.corners.lower_left, self.corners.lower_right, self.corners.upper_left
        return math.dist(low, right), math.dist(low, high)

    @property
    def packed(self) -> bool:
        """Whether one image holds both eyes."""
        return self.stereo in PACKED


class WallConfig(Model):
    """All panels: `grid` or `panels`."""

    bezel: Literal["hide", "skip"] = Field(
        default="hide",
        description="hide: the scene goes on behind bezels; skip: nothing is hidden, every panel shows its own bezels' "
        "part of the scene too, squeezed",
    )
    grid: GridConfig | None = Field(default=None, description="equal panels in one plane")
    panels: Annotated[tuple[PanelConfig, ...], Field(min_length=1, max_length=MAX_PANELS)] | None = Field(
        default=None, description="panels one by one"
    )

    @model_validator(mode="after")
    def _one_kind(self) -> WallConfig:
        if (self.grid is None) == (self.panels is None):
            came = "has neither a grid nor panels" if self.grid is None else "has both a grid and panels"
            raise refusal(came, accepted="exactly one of grid, panels")
        panels = self.panels or ()
        if (count := len(panels) + sum(panel.packed for panel in panels)) > MAX_PANELS:
            raise refusal(f"{count} panels, one an eye, are too many", accepted=f"at most {MAX_PANELS}", at=("panels",))
        seen: dict[str, int] = {}
        for i, panel in enumerate(panels):
            for name in (f"{panel.id}.left", f"{panel.id}.right", panel.id) if panel.packed else (panel.id,):
                if name in seen:
                    came = f"panel {seen[name]} has this id already"
                    came += "" if name == panel.id else f", as its eye {name}"
                    raise refusal(came, accepted="ids that differ", at=("panels", i, "id"))
                if len(name) > LONGEST_ID:
                    raise refusal(
                        f"is too long for {name}", accepted=f"{LONGEST_ID - 6} letters", at=("panels", i, "id")
                    )
                seen[name] = i
        return self
