"""Choose what reconstructs images: the CPU, or a GPU that does the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64, Rect, Samples
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.deepbuffer.pose import Posed
from wall.geometry.panels import Panel
from wall.reconstruction.gpu.device import GpuError, device, gpu_nodes
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Ingredients, Reconstruction
from wall.reconstruction.stored import StoredSamples
from wall.scene.build import Scene
from wall.scene.needs import needs

Wish = Literal["auto", "cpu", "gpu"]
LayerReconstruction: TypeAlias = Reconstruction | GpuReconstruction  # of all channels that compositing needs


class AnyReconstruction(Protocol):
    """What Reconstruction (CPU) and GpuReconstruction have in common: samples in, an image of them out."""

    rect: Rect

    @property
    def nothing_moves(self) -> bool:
        """True if neither camera nor objects moved since the last refresh."""

    @property
    def radiance(self) -> Float32:
        """The image, (h, w, 3) float32 linear RGB."""

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        """Inserts samples whose times count from `base_time`, in seconds, posed by `event`."""

    def refresh(self, event: Event, now: float) -> None:
        """Reprojects the samples to `event` and reconstructs the image of time `now`, in seconds."""

    def clear(self) -> None:
        """Removes all samples."""

    def take_dirty(self) -> NDArray[np.bool_]:
        """Returns the tiles that changed since the last call, as a mask, and resets them."""

    def display(self, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8], *, tone: Tone = AS_IT_IS) -> None:
        """Redoes the dirty tiles of `rgb` (h, w, 3) uint8, sRGB, exposed and mapped."""

    def stored(self) -> StoredSamples:
        """Returns the stored samples."""

    def accumulated_counts(self) -> Float32:
        """Returns how many samples each pixel's mean has accumulated, (h, w) float32."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """`on` reconstructs; `why` is for a reader."""

    on: Literal["cpu", "gpu"]
    why: str

    def __str__(self) -> str:
        return f"{self.on} ({self.why})"


def choose(wish: Wish) -> Choice:
    """Choose by a wish and this machine, for the calling thread. Raises GpuError if `gpu` is asked for in vain."""
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


def why_not_on_gpu(scene: Scene, panel: Panel) -> str:
    """Why the CPU reconstructs a panel of a scene whatever there is; "" where a GPU can."""
    if needs(scene).paths:
        return "the noise of paths is filtered there alone"
    if panel.scan is not None:
        return f"panel {panel.id} has a row_time, and on a GPU all rows of an image show one moment"
    return ""


class Made(NamedTuple):
    """What reconstructs a panel."""

    image: LayerReconstruction
    coverage: LayerReconstruction | None  # a second image, of where objects are; see channels.Coverage
    choice: Choice


def make_reconstruction(
    wish: Wish, panel: Panel, eye: Float64, scene: Scene, *,
    samples_per_pixel: float, threads: int = 1, transparent: bool = False,
) -> Made:  # fmt: skip
    """Make a panel's reconstruction where the wish says; `threads` share it on the CPU. `transparent`: with coverage.

    Raises GpuError if `gpu` is asked for and cannot do it.
    """
    choice, kept = choose(wish), samples_per_pixel
    if choice.on == "gpu":
        try:
            image = GpuReconstruction(panel, eye, scene, samples_per_pixel=kept)
            covers = (
                GpuReconstruction(panel, eye, scene, samples_per_pixel=kept, relighting=False) if transparent else None
            )
        except GpuError as error:
            if wish == "gpu":
                raise
            choice = Choice(on="cpu", why=error.problem)
        else:
            return Made(image, covers, choice)
    alone = Ingredients(relighting=False, filtering=False)  # coverage has neither light nor noise
    return Made(
        Reconstruction(panel, eye, scene, detects_change=False, samples_per_pixel=kept, threads=threads),
        Reconstruction(panel, eye, scene, detects_change=False, samples_per_pixel=kept, ingredients=alone)
        if transparent
        else None,
        choice,
    )
