"""Models of one panel's display: colour, edge blending, warp, and the X display and monitor that show it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from annotated_types import Ge, Le
from pydantic import BeforeValidator, Discriminator, Field, Tag

from wall.core.fields import Gamma, Model, Number, Text, Whole
from wall.operators.warp import Mesh

Pixels = Annotated[Whole, Ge(1), Le(16384)]
Width = Annotated[Number, Ge(0.0), Le(100.0)]
Gain = Annotated[Number, Ge(0.0), Le(16.0)]
PixelPlace = Annotated[Whole, Ge(-65536), Le(65536)]
RowTime = Annotated[Number, Ge(0.0), Le(0.01)]


class SidesConfig(Model):
    """A width at each side of a panel, as its viewer sees it."""

    left: Width = Field(default=0.0, description="metres")
    right: Width = Field(default=0.0, description="metres")
    top: Width = Field(default=0.0, description="metres")
    bottom: Width = Field(default=0.0, description="metres")

    @property
    def across(self) -> float:
        """Left and right together, metres."""
        return self.left + self.right

    @property
    def down(self) -> float:
        """Top and bottom together, metres."""
        return self.top + self.bottom


def is_number(value: object) -> bool:
    """Whether a value of the YAML is one number, which may stand for several equal ones."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _all_sides(value: Any) -> Any:
    return dict.fromkeys(SidesConfig.model_fields, value) if is_number(value) else value


Sides = Annotated[SidesConfig, BeforeValidator(_all_sides, json_schema_input_type=Width | SidesConfig)]


def _three(value: Any) -> Any:
    return [value] * 3 if is_number(value) else value


Gains = Annotated[
    tuple[Gain, Gain, Gain], BeforeValidator(_three, json_schema_input_type=Gain | tuple[Gain, Gain, Gain])
]


class ColourConfig(Model):
    """How one display differs from the others: lut(gain * light ^ gamma), the table on display values."""

    gain: Gains = Field(default=(1.0, 1.0, 1.0), description="one factor, or red, green, blue")
    gamma: Gamma = Field(default=1.0, description="exponent, 1 = as it comes")
    lut: Text | None = Field(default=None, description="3D look-up table, a .cube file beside this one")


class BlendConfig(SidesConfig):
    """Width of the ramp at each side where a neighbouring projector lights the same area."""

    gamma: Gamma = Field(default=2.2, description="of the projector: light = value ^ gamma; two ramps make one light")


WORD_OR_NOT = Discriminator(lambda value: "<word>" if isinstance(value, str) else "<other>")

Blend = Annotated[
    Annotated[Literal["none", "auto"], Tag("<word>")] | Annotated[BlendConfig, Tag("<other>")], WORD_OR_NOT
]


class WarpFileConfig(Model):
    """The same in a file of its own."""

    file: Text = Field(
        description="YAML with columns, rows and points, or .npy with a position in the image for each pixel; beside "
        "this file"
    )


def _kind_of_warp(value: Any) -> str:
    file = "file" in value if isinstance(value, dict) else isinstance(value, WarpFileConfig)
    return "<file>" if file else "<grid>"


Warp = Annotated[
    Annotated[WarpFileConfig, Tag("<file>")] | Annotated[Mesh, Tag("<grid>")], Discriminator(_kind_of_warp)
]


class WindowConfig(Model):
    """A part of a display or monitor."""

    x: PixelPlace = Field(default=0, description="left edge, pixels of the monitor (or of the display)")
    y: PixelPlace = Field(default=0, description="top edge, pixels of the monitor (or of the display)")
    width: Pixels = Field(description="pixels")
    height: Pixels = Field(description="pixels")


Monitor = Annotated[
    Annotated[Annotated[Whole, Ge(0), Le(255)], Tag("<other>")] | Annotated[Text, Tag("<word>")], WORD_OR_NOT
]
