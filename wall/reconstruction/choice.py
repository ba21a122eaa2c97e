"""Who makes pictures of reprojected samples: the CPU, or a GPU that does the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64, Rect, Samples
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.geometry.panels import Panel
from wall.reconstruction.display_values import update_display
from wall.reconstruction.gpu.device import GpuError, device, gpu_nodes
from wall.reconstruction.gpu.picture import GpuPicture
from wall.reconstruction.picture import Picture
from wall.reconstruction.pose import Posed
from wall.scene.build import Scene

Wish = Literal["auto", "cpu", "gpu"]


class Reprojected(Protocol):
    """A picture of reprojected samples, whoever makes it; see Picture."""

    rect: Rect
    nothing_moves: bool

    @property
    def radiance(self) -> Float32: ...

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None: ...
    def refresh(self, event: Event, now: float) -> None: ...
    def clear(self) -> None: ...
    def take_dirty(self) -> NDArray[np.bool_]: ...
    def stored(self) -> tuple[Float32, Float32, int, float]: ...
    def still_counts(self) -> Float32: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """`on` makes the pictures; `why` is for a reader."""

    on: Literal["cpu", "gpu"]
    why: str

    def __str__(self) -> str:
        return f"{self.on} ({self.why})"


def choose(wish: Wish) -> Choice:
    """What a wish comes to on this machine, for the calling thread. Raises GpuError if `gpu` is asked for in vain."""
    if wish == "cpu":
        return Choice(on="cpu", why="asked for")
    if wish == "auto" and not gpu_nodes():  # no driver is loaded for nothing
        return Choice(on="cpu", why="this machine has no GPU")
    try:
        found = device()
    except GpuError as error:
        if wish == "gpu":
            raise
        return Choice(on="cpu", why=error.problem)
    if wish == "auto" and not found.real:
        return Choice(on="cpu", why=f"{found.renderer} is a program on the CPU")
    return Choice(on="gpu", why=found.renderer)


def make_picture(
    wish: Wish, panel: Panel, eye: Float64, scene: Scene, *, samples_per_pixel: float
) -> tuple[Reprojected, Choice]:
    """A panel's picture where the wish says. Raises GpuError if `gpu` is asked for and cannot do it."""
    choice = choose(wish)
    if choice.on == "gpu":
        try:
            return GpuPicture(panel, eye, scene, samples_per_pixel=samples_per_pixel), choice
        except GpuError as error:
            if wish == "gpu":
                raise
            choice = Choice(on="cpu", why=error.problem)
    return Picture(panel, eye, scene, judging=False, samples_per_pixel=samples_per_pixel), choice


def display(picture: Reprojected, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8]) -> None:
    """Redo the dirty tiles of `rgb` (h, w, 3) uint8 from a picture. Raises GpuError if its GPU has given up."""
    if isinstance(picture, GpuPicture):
        picture.display(dirty, rgb)
    else:
        update_display(picture.radiance, dirty, TILE, rgb)
