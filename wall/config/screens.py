"""`wall:` where the panels stand, in metres and pixels: a regular grid, or panels one by one."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any

from annotated_types import Ge, Le
from pydantic import BeforeValidator, Field, model_validator

from wall.fields import NAME_PATTERN, Model, Name, Number, Point, Text, Whole, refusal

MAX_PANELS = 1024
SQUARENESS = 0.01  # cosine of the corner angle: half a degree off is a typing error, not a panel

Pixels = Annotated[Whole, Ge(1), Le(16384)]
Metres = Annotated[Number, Ge(1e-4), Le(1e4)]
Width = Annotated[Number, Ge(0.0), Le(100.0)]


class BezelConfig(Model):
    """The dark frame around one panel's lit area."""

    left: Width = Field(default=0.0, description="metres")
    right: Width = Field(default=0.0, description="metres")
    top: Width = Field(default=0.0, description="metres")
    bottom: Width = Field(default=0.0, description="metres")


def _all_sides(value: Any) -> Any:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return {"left": value, "right": value, "top": value, "bottom": value}
    return value


Bezel = Annotated[BezelConfig, BeforeValidator(_all_sides, json_schema_input_type=Width | BezelConfig)]


IdPattern = Annotated[Text, Field(max_length=64)]


def _check_bezel(bezel: BezelConfig, size: tuple[float, float]) -> None:
    if max(bezel.left, bezel.right) > size[0] or max(bezel.top, bezel.bottom) > size[1]:
        most = f"at most {size[0]:g} m at the sides, {size[1]:g} m above and below"
        raise refusal("is wider than the panel itself", accepted=most, at=("bezel",))


class GridConfig(Model):
    """Equal panels in rows and columns, all in one plane, its centre at the origin of the wall's frame."""

    columns: Annotated[Whole, Ge(1), Le(256)] = Field(description="panels side by side")
    rows: Annotated[Whole, Ge(1), Le(256)] = Field(description="panels on top of each other")
    pixels: tuple[Pixels, Pixels] = Field(description="width and height of one panel, pixels")
    size: tuple[Metres, Metres] = Field(description="width and height of one panel's lit area, metres")
    bezel: Bezel = Field(default=BezelConfig(), description="dark frame, metres: one number or four sides")
    id: IdPattern = Field(default="r{row}c{column}", description="pattern of the panels' ids; row 0 is the top one")

    @model_validator(mode="after")
    def _ids_differ(self) -> GridConfig:
        _check_bezel(self.bezel, self.size)
        if self.columns * self.rows > MAX_PANELS:
            raise refusal(f"{self.columns} x {self.rows} panels are too many", accepted=f"at most {MAX_PANELS}")
        ids = {self.panel_id(row, column) for row in range(self.rows) for column in range(self.columns)}
        if len(ids) < self.columns * self.rows:
            raise refusal("gives two panels the same id", accepted="text with {row} and {column}", at=("id",))
        if bad := next((i for i in sorted(ids) if not _is_name(i)), None):
            raise refusal(f"gives the id {bad!r}", accepted="letters, digits, '.', '_' and '-'", at=("id",))
        return self

    def panel_id(self, row: int, column: int) -> str:
        return self.id.replace("{row}", str(row)).replace("{column}", str(column))


def _is_name(text: str) -> bool:
    return re.fullmatch(NAME_PATTERN, text) is not None


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
        if min(width, height) < 1e-4:
            raise refusal(f"span {width:g} x {height:g} m", accepted="at least 0.0001 m each way")
        cosine = sum(a * b for a, b in zip(right, up, strict=True)) / (width * height)
        if abs(cosine) > SQUARENESS:
            angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
            raise refusal(f"meet at {angle:.1f} degrees", accepted="a right angle at lower_left")
        return self


class PanelConfig(Model):
    """One panel, wherever it stands."""

    id: Name = Field(description="letters, digits, '.', '_' and '-'; used in file names")
    pixels: tuple[Pixels, Pixels] = Field(description="width and height, pixels")
    corners: CornersConfig = Field(description="where the lit area is")
    bezel: Bezel = Field(default=BezelConfig(), description="dark frame, metres: one number or four sides")
    host: Text | None = Field(default=None, description="machine the panel hangs on; absent = any")

    @model_validator(mode="after")
    def _bezel_is_thin(self) -> PanelConfig:
        corners = self.corners
        width = math.dist(corners.lower_left, corners.lower_right)
        _check_bezel(self.bezel, (width, math.dist(corners.lower_left, corners.upper_left)))
        return self


class WallConfig(Model):
    """All panels: `grid` or `panels`."""

    grid: GridConfig | None = Field(default=None, description="equal panels in one plane")
    panels: Annotated[tuple[PanelConfig, ...], Field(min_length=1, max_length=MAX_PANELS)] | None = Field(
        default=None, description="panels one by one"
    )

    @model_validator(mode="after")
    def _one_kind(self) -> WallConfig:
        if (self.grid is None) == (self.panels is None):
            came = "has neither a grid nor panels" if self.grid is None else "has both a grid and panels"
            raise refusal(came, accepted="exactly one of grid, panels")
        seen: dict[str, int] = {}
        for i, panel in enumerate(self.panels or ()):
            if panel.id in seen:
                raise refusal(
                    f"panel {seen[panel.id]} has this id already",
                    accepted="ids that differ",
                    at=("panels", i, "id"),
                )
            seen[panel.id] = i
        return self
