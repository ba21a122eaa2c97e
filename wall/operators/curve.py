"""`curve`: what a curved panel's pixels take from the flat image that is made for it.

A pixel takes the flat image's colour on the line from the eye through the point that it lights. Where the line goes is
exact but for rounding to 1/4096 pixel, for every pixel; how sharp the colour is depends on the flat image's density.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from wall.core.data import STILL, Event, Float64, Framelet, Rect
from wall.core.fields import Name
from wall.operators.base import Input, Operator
from wall.operators.kernels import resample as kernels
from wall.operators.regions import look_up


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurvedImage:
    """A panel's surface, and the plane of its flat image. Metres, wall frame."""

    centres: Callable[[], Float64]  # gives (h, w, 3): the points that the pixels light
    window: Float64  # (3, 3) rows: the flat image's top left corner, a pixel to the right, a pixel down
    eye: Float64  # (3,) who looks at it
    tracked: bool  # whether the eye that an event tells moves this one


class Positions:
    """Where the pixels of a curved panel are in its flat image, for the newest eye that was asked for."""

    def __init__(self, image: CurvedImage) -> None:
        self._image, self._eye = image, image.eye
        self._centres: Float64 | None = None
        self._table: NDArray[np.int32] | None = None

    def table(self, event: Event | None) -> NDArray[np.int32]:
        """(h, w, 2) int32 under the eye of an event, see kernels.look_up_bilinear."""
        image = self._image
        moved = np.array(event.camera.eye if event is not None and image.tracked else STILL.eye)
        eye = image.eye + moved
        if self._table is None or not np.array_equal(eye, self._eye):
            if self._centres is None or self._table is None:
                self._centres = image.centres()
                self._table = np.empty((*self._centres.shape[:2], 2), np.int32)
            corner, per_x, per_y = image.window
            flat_from_wall = np.linalg.inv(np.array([corner - eye, per_x, per_y]).T)
            kernels.project_points(self._centres, eye, np.ascontiguousarray(flat_from_wall), self._table)
            self._eye = eye
        return self._table


class Curve(Operator):
    """As large as the input, the flat image of a curved panel; windows do this by themselves.

    Colour, alpha and variance are interpolated between the four pixels around a position, which is known to 1/4096
    pixel; depth, time and object are those of the nearest.
    """

    op: Literal["curve"] = Field(description="a curved panel's flat image as its surface shows it")
    input: Input
    panel: Name = Field(description="id of the curved panel")

    KEEPS_RAYS: ClassVar[bool] = False

    _image: CurvedImage | None = PrivateAttr(default=None)

    def placed(self, image: CurvedImage) -> Curve:
        """The same node, which knows its panel."""
        node = self.model_copy()
        node._image = image
        return node

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """All of it: where a part of the flat image goes depends on the eye."""
        return inputs[0]

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Positions:
        """What keeps the positions of the pixels."""
        assert self._image is not None
        return Positions(self._image)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Positions) -> None:
        """Write the pixels of a region."""
        look_up(inputs[0], out, region, prepared.table(inputs[0].event)[region.inside(out.rect)])
