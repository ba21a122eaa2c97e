"""Base class and field types of all configuration models: numbers, vectors, colours.

Models are frozen, unknown keys are refused, and nothing is coerced: "480" is not 480 and true is not 1.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any

from annotated_types import Ge, Gt, Le
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, StrictBool, StrictStr
from pydantic_core import PydanticCustomError

from wall.core.colour import light_of_code

FARTHEST = 1e12  # world units; beyond it float64 positions are coarser than 0.1 mm
BRIGHTEST = 1e9  # keeps products of light and reflectance finite in float32
MOST_STRENGTH = 1e6  # factor of the light of a sky or an environment
SMALLEST_IOR, LARGEST_IOR = 1.01, 4.0  # index of refraction
MOST_DEPTH = 64  # surfaces of a path
SRGB_PATTERN = "^#[0-9A-Fa-f]{6}$"
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"  # fit for file names

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Whole = Annotated[int, Field(strict=True)]
Flag = StrictBool
Text = Annotated[StrictStr, Field(min_length=1, max_length=4096)]
Name = Annotated[StrictStr, Field(min_length=1, max_length=64, pattern=NAME_PATTERN)]
Positive = Annotated[Number, Gt(0.0), Le(FARTHEST)]
Coordinate = Annotated[Number, Ge(-FARTHEST), Le(FARTHEST)]
Brightness = Annotated[Number, Ge(0.0), Le(BRIGHTEST)]
Seconds = Annotated[Number, Ge(0.0), Le(1e6)]
Period = Annotated[Number, Ge(0.01), Le(1e6)]
RefreshRate = Annotated[Number, Ge(0.1), Le(1000.0)]  # Hz
Share = Annotated[Number, Ge(0.0), Le(1.0)]
Depth = Annotated[Whole, Ge(1), Le(MOST_DEPTH)]
Gamma = Annotated[Number, Ge(0.1), Le(10.0)]
Order = Annotated[Whole, Ge(-1000), Le(1000)]  # of layers

Point = tuple[Coordinate, Coordinate, Coordinate]


class Model(BaseModel):
    """Base of every configuration model."""

    model_config = ConfigDict(extra="forbid", frozen=True, hide_input_in_errors=True)


def refusal(problem: str, *, accepted: str = "", at: tuple[str | int, ...] = ()) -> PydanticCustomError:
    """The error that a validator raises; `at` leads from the validated value to the culprit inside it."""
    context: dict[str, Any] = {"problem": problem, "accepted": accepted, "at": at}
    return PydanticCustomError("refused", "{problem}", context)


def _linear(color: Any) -> Any:
    """Linear RGB of a code #rrggbb; what is no text as it came."""
    if not isinstance(color, str):
        return color
    if not re.fullmatch(SRGB_PATTERN, color):
        raise refusal("is no colour", accepted="'#rrggbb' (sRGB), or [red, green, blue], linear")
    return tuple(light_of_code(color))


_Code = Annotated[StrictStr, Field(pattern=SRGB_PATTERN, description="sRGB as #rrggbb")]
Color = Annotated[  # linear, or #rrggbb
    tuple[Brightness, Brightness, Brightness],
    BeforeValidator(_linear, json_schema_input_type=tuple[Brightness, Brightness, Brightness] | _Code),
]
Reflectance = Annotated[  # so too, to 1
    tuple[Share, Share, Share], BeforeValidator(_linear, json_schema_input_type=tuple[Share, Share, Share] | _Code)
]


def _with_length(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if math.hypot(*vector) < 1e-9:
        raise refusal("has no direction", accepted="three numbers that are not all zero")
    return vector


Direction = Annotated[tuple[Coordinate, Coordinate, Coordinate], AfterValidator(_with_length)]


def check_one_named(first: str, one: object, second: str, other: object) -> None:
    """Refuse a model that names neither or both of two things; `first`, `second`: its fields of them."""
    if (one is None) == (other is None):
        came = f"names neither an {first} nor a {second}" if one is None else f"names both an {first} and a {second}"
        raise refusal(came, accepted=f"exactly one of {first}, {second}")


def check_times(times: list[float]) -> None:
    """Refuse keyframe times that do not grow."""
    for i in range(1, len(times)):
        if times[i] <= times[i - 1]:
            raise refusal(
                f"does not come after the keyframe before it ({times[i - 1]:g} s)",
                accepted=f"a time above {times[i - 1]:g}",
                at=("keyframes", i, "time"),
            )
