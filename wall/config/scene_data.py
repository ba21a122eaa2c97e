"""Models of `scene.data:`: points and fields of measurements and simulations, and their colours."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from wall.core.color_maps import ColorMap
from wall.core.fields import Flag, Model, Number, Period, Point, Positive, Reflectance, Seconds, Text, Whole, refusal

Column = Text | Annotated[Whole, Ge(0), Le(65535)]
Three = tuple[Column, Column, Column]


class RadiusColumnConfig(Model):
    """Radii from a column."""

    column: Column = Field(description="name, or number from 0")
    factor: Positive = Field(default=1.0, description="by which its numbers are multiplied to world units")


class ColorColumnsConfig(Model):
    """Colours from one column, through a colour map, or from three."""

    column: Column | None = Field(default=None, description="name, or number from 0: numbers for a colour map")
    color_map: ColorMap = Field(default=ColorMap(), description="which colours stand for the column's numbers")
    columns: Three | None = Field(
        default=None, description="instead: red, green and blue, sRGB, whole numbers 0..255 or others 0..1"
    )

    @model_validator(mode="after")
    def _one_kind(self) -> ColorColumnsConfig:
        if (self.column is None) == (self.columns is None):
            raise refusal("needs either a column or three columns", accepted="one of column, columns")
        return self


class SeriesConfig(Model):
    """Steps in time, of which one is shown at a moment of the scene's time."""

    step_s: Period | None = Field(
        default=None,
        description="seconds of scene time from a step to the next; absent = the times that a .pvd or .series file has",
    )
    start_s: Seconds = Field(default=0.0, description="scene time of the first step, which is shown before it too")
    loop: Flag = Field(
        default=False, description="whether the first step follows the last; else the last is shown from then on"
    )


class _DataConfig(Model):
    file: Text = Field(description="relative to this file")
    name: Text | None = Field(default=None, description="of the object and of its material; absent = the file's name")
    up: Literal["x", "y", "z", "-x", "-y", "-z"] = Field(
        default="y", description="which way is up in the file; it is turned so that it is y"
    )
    scale: Positive = Field(default=1.0, description="by which the file's coordinates are multiplied")
    position: Point = Field(default=(0.0, 0.0, 0.0), description="where the file's origin is put, world units")
    color: Reflectance | None = Field(default=None, description="linear RGB of all of it, 0..1")
    series: SeriesConfig | None = Field(
        default=None,
        description="file is a series of steps in time: a pattern with one * for the number, such as wave_*.vti, a "
        ".pvd or .series file that names them, a .npy of points whose first axis is time, or drum, which is built in",
    )


class _RowsConfig(_DataConfig):
    columns: Three | None = Field(
        default=None, description="of the coordinates; absent = x, y, z, or the first three numbers of a row"
    )
    radius: Positive | RadiusColumnConfig = Field(description="units of the file, or a column of it")
    color_by: ColorColumnsConfig | None = Field(
        default=None, description="colours from columns; absent = red, green, blue of the file, where it has them"
    )

    @model_validator(mode="after")
    def _one_colour(self) -> _RowsConfig:
        mapped = self.color_by is not None and self.color_by.column is not None
        _check_colors(self, self.color_by.color_map if mapped and self.color_by else None)
        return self


class PointsConfig(_RowsConfig):
    """Points, each drawn as a sphere."""

    type: Literal["points"] = Field(description="points, each drawn as a sphere")
    file: Text = Field(
        description="relative to this file: .ply, .npy, .npz, .csv, .txt or .xyz; or galaxy, which is built in"
    )


class CurvesConfig(_RowsConfig):
    """Curves, such as streamlines and hair, each drawn as a round tube through its points."""

    type: Literal["curves"] = Field(description="streamlines, hair: round tubes through points")
    file: Text = Field(
        description="relative to this file: lines of a .vtp, .vtk or .vtu, which need wall[data]; .npy "
        "(curves, points, columns); .npz, .csv, .txt or .ply with a column named curve; or lorenz, which is built in"
    )


def _check_colors(config: _RowsConfig | _FieldConfig, color_map: ColorMap | None) -> None:
    """Refuse two ways to colour, and a series whose steps would each have colours of their own."""
    if config.color is not None and config.color_by is not None:
        raise refusal("names both a color and a color_by", accepted="one of color, color_by")
    if config.series is not None and color_map is not None and color_map.range is None:
        at = ("color_by", "color_map", "range")
        raise refusal("is absent, and a series is not read whole to find it", accepted="[lower, upper]", at=at)


class ArrayColorConfig(Model):
    """Colours of the numbers of an array."""

    array: Text = Field(description="name of an array of points or cells; of vectors the length is taken")
    color_map: ColorMap = Field(default=ColorMap(), description="which colours stand for which numbers")


class _FieldConfig(_DataConfig):
    color_by: ArrayColorConfig | None = Field(default=None, description="colours from an array; absent = one colour")

    @model_validator(mode="after")
    def _one_colour(self) -> _FieldConfig:
        _check_colors(self, None if self.color_by is None else self.color_by.color_map)
        return self


class SurfaceConfig(_FieldConfig):
    """The surface of a VTK file: its polygons, or the outer faces of its cells."""

    type: Literal["surface"] = Field(description="polygons of a VTK file, or the outer faces of its cells")
    file: Text = Field(description="relative to this file: .vtp, .vtu, .vtk, .vti, .vts or .vtr; needs wall[data]")


class IsosurfaceConfig(_FieldConfig):
    """Where a field has a value."""

    type: Literal["isosurface"] = Field(description="where a field of a VTK file has a value")
    file: Text = Field(
        description="relative to this file: .vti, .vtu, .vtk, .vts, .vtr, .mha or .mhd; or orbital, which is built in; "
        "needs wall[data]"
    )
    array: Text | None = Field(
        default=None, description="name of the field, of vectors the length is taken; absent = the file's only one"
    )
    value: Number | Annotated[tuple[Number, ...], Field(min_length=1, max_length=64)] = Field(
        description="of the field, or several: a surface each"
    )

    @model_validator(mode="after")
    def _one_of_a_series(self) -> IsosurfaceConfig:
        if self.series is not None and isinstance(self.value, tuple) and len(self.value) > 1:
            raise refusal(
                f"names {len(self.value)} values of a series",
                accepted="one; more in entries of their own",
                at=("value",),
            )
        return self


DataConfig = Annotated[PointsConfig | CurvesConfig | SurfaceConfig | IsosurfaceConfig, Field(discriminator="type")]
