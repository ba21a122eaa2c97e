"""Models of `tracking:` of a view: where a tracker's packets come from, and how its coordinates become the wall's."""

from __future__ import annotations

import ipaddress
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le
from pydantic import AfterValidator, Field, model_validator

from wall.core.fields import Model, Number, Text, Whole, refusal

FARTHEST_M = 1000.0

Axis = Literal["x", "-x", "y", "-y", "z", "-z"]
Metres = Annotated[Number, Ge(-FARTHEST_M), Le(FARTHEST_M)]


def _is_address(text: str) -> str:
    try:
        return str(ipaddress.ip_address(text))
    except ValueError:
        raise refusal("is not an IP address", accepted="such as 192.168.1.20, or 127.0.0.1 for this machine") from None


def _is_osc_address(text: str) -> str:
    if not text.startswith("/") or not text.isascii() or not text.isprintable() or set(text) & set(" #*,?[]{}"):
        raise refusal("is not an OSC address", accepted="such as /head: a slash, then ASCII without any of #*,?[]{}")
    return text


class TrackingConfig(Model):
    """The viewer's eye as a tracker has it, told by OSC over UDP."""

    port: Annotated[Whole, Ge(1), Le(65535)] = Field(default=7000, description="UDP port that the head listens at")
    source: Annotated[Text, AfterValidator(_is_address)] = Field(
        default="127.0.0.1",
        description="IP address of the tracker's machine; packets of all others are dropped. 127.0.0.1: this machine, "
        "and only it can reach the port",
    )
    address: Annotated[Text, AfterValidator(_is_osc_address)] = Field(
        default="/head", description="OSC address of the messages that tell where the eye is"
    )
    first: Annotated[Whole, Ge(0), Le(61)] = Field(
        default=0, description="how many arguments of a message come before the x, y and z of the position"
    )
    metres_per_unit: Annotated[Number, Gt(0.0), Le(1000.0)] = Field(
        default=1.0, description="metres that a 1 of the tracker means: 0.001 where it tells millimetres"
    )
    axes: tuple[Axis, Axis, Axis] = Field(
        default=("x", "y", "z"),
        description="the tracker's axes that point along the wall's x (right), y (up) and z (to the viewer)",
    )
    origin: tuple[Metres, Metres, Metres] = Field(
        default=(0.0, 0.0, 0.0),
        description="where the eye is when the tracker tells 0, 0, 0, metres in the wall's frame",
    )
    reach: Annotated[Number, Ge(0.0), Le(100.0)] = Field(
        default=0.3,
        description="metres along each axis that the eye may move from the view's `eye` and still see all of curved "
        "panels; beyond, their edges are smeared",
    )
    delay_s: Annotated[Number, Ge(0.0), Le(0.2)] = Field(
        default=0.01, description="seconds from a movement to the arrival of its packet, which prediction makes up for"
    )

    def cannot_share_port(self, other: TrackingConfig) -> bool:
        """Whether both want one port, for addresses of different kinds."""
        return self.port == other.port and (":" in self.source) != (":" in other.source)

    @model_validator(mode="after")
    def _axes_differ(self) -> TrackingConfig:
        if len({axis[-1] for axis in self.axes}) < 3:
            raise refusal(
                "names an axis twice", accepted="x, y and z in any order, each with a minus or not", at=("axes",)
            )
        return self
