"""Dynamic resolution: an image that is made of fewer pixels while there is no time for all of them, and enlarged.

Where fewer samples come than pixels move, an image of all pixels is mostly holes: surfaces show through each other in
single pixels. Of a quarter of the pixels it is whole. Stored samples are points of objects, so they go with the image
from one resolution to another.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Camera, Event, Float32, Float64, Rect, Samples
from wall.core.threads import Threads
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.deepbuffer.deep_buffer import SAMPLES_PER_PIXEL
from wall.deepbuffer.feedback import Feedback
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.pose import Posed
from wall.geometry.panels import Panel, of_fewer_pixels
from wall.reconstruction.display_values import update_display
from wall.reconstruction.enlarging import Axis, CubicAxis
from wall.reconstruction.kernels import enlarge as kernels
from wall.reconstruction.reconstruction import Reconstruction
from wall.reconstruction.stored import StoredSamples
from wall.scene.build import Scene

FINER = 4.25  # samples a pixel: one for each pixel of an image of twice as many each way, sizes being rounded


class DynamicResolution:
    """The image of a whole panel, made at one of a few resolutions: `scale` pixels of the panel are one, each way.

    Samples are given, and feedback is read, in the pixels of that resolution: see `to_image` and `to_panel`.
    """

    def __init__(
        self, panel: Panel, eye: Float64, scene: Scene, *, detects_change: bool,
        samples_per_pixel: float = SAMPLES_PER_PIXEL, threads: int = 1, scale: int = 1,
    ) -> None:  # fmt: skip
        """`scale` to begin with; others: see Reconstruction."""
        self._panel, self._threads, self._samples_per_pixel = panel, Threads(threads), samples_per_pixel
        self._make: Callable[..., Reconstruction] = partial(
            Reconstruction, eye=eye, scene=scene, detects_change=detects_change, threads=threads, settles=True
        )
        self.scale, self._next, self._whole, self.refreshes = scale, scale, False, 0
        self.gathers = False  # keep enough samples for an image that is finer by one step
        self._made: dict[int, Reconstruction] = {}
        self._make_at(scale)
        self.rect = Rect(x=0, y=0, width=panel.pixels[0], height=panel.pixels[1])
        self._share, self._rescaled = 1.0, False  # since tiles were taken
        self._enlarged: Enlarged | None = None
        Enlarged(Rect(x=0, y=0, width=1, height=1), Rect(x=0, y=0, width=2, height=2)).compile()

    @property
    def current(self) -> Reconstruction:
        """The reconstruction at the resolution of now."""
        return self._made[self.scale]

    def rescale(self, scale: int, *, whole: bool = False) -> None:
        """From the next refresh on make the image at another resolution, of the samples that are stored.

        `whole`: each of its pixels has a sample. Else, while nothing moves, pixels go over from what an image of fewer
        of them shows to samples of their own.
        """
        self._next, self._whole = scale, whole

    def begin(self, scale: int) -> None:
        """Forget every sample, and store those that come in an image of that resolution from now on."""
        self._make_at(scale)
        self.scale, self._next, self._rescaled = scale, scale, True
        self.current.clear()
        self._keep()

    def covers(self, camera: Camera) -> float:
        """The share of the image that the stored samples would show to another camera, roughly."""
        return self.current.buffer.covers(camera)

    def _rescale(self, event: Event) -> None:
        self._make_at(self._next)
        before, finer = self.current, self._next < self.scale
        self.scale, self._rescaled = self._next, True
        self._keep()
        shown = before.poses.shown
        goes_on = finer and not self._whole and before.at_rest and shown is not None and shown.number == event.number
        prior = Enlarged(before.rect, self.current.rect).as_shown(before.radiance) if goes_on else None
        self.current.take_over(before, prior)

    def _make_at(self, scale: int) -> None:
        if scale not in self._made:
            panel = of_fewer_pixels(self._panel, 1.0 / scale)
            self._made[scale] = self._make(panel, samples_per_pixel=self._most_at(scale))

    def _most_at(self, scale: int) -> float:
        """Samples a pixel that an image has room for: of one of fewer pixels, what the next finer one has."""
        return self._samples_per_pixel if scale == 1 else max(self._samples_per_pixel, FINER)

    def to_image(self, samples: Samples) -> Samples:
        """Samples of the panel as samples of the image that is made: themselves at full resolution, else copies."""
        if self.scale == 1:
            return samples
        scaled = samples.copy()
        rect = self.current.rect
        scaled["xy"] = inside(samples["xy"] * self._ratio(), rect)
        return scaled

    def to_panel(self, xy: Float32) -> Float32:
        """Positions in the image that is made, (n, 2) float32, as positions on the panel."""
        return xy if self.scale == 1 else inside(xy / self._ratio(), self.rect)

    def _ratio(self) -> Float32:
        rect = self.current.rect
        return np.array([rect.width / self.rect.width, rect.height / self.rect.height], np.float32)

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        """Store samples, see to_image; their `change` is written if changes are detected."""
        self.current.insert(samples, base_time, event)

    def forget(self, samples: Samples, base_time: float) -> None:
        """Reject the samples of one insert, see to_image."""
        self.current.forget(samples, base_time)

    def keep(self, share: float) -> None:
        """Keep that share of the samples that are kept where refreshes are made in time."""
        self._share = share
        self._keep()

    def _keep(self) -> None:
        wanted = self._share * self._samples_per_pixel / self._most_at(self.scale)
        self.current.buffer.keep(1.0 if self.gathers and self.scale > 1 else wanted)

    def refresh(self, event: Event, now: float) -> None:
        """Show the samples under `event`, see Reconstruction."""
        if self._next != self.scale:
            self._rescale(event)
        self.current.refresh(event, now)
        self.refreshes += 1

    def feedback(self) -> Feedback:
        """What a sampler of the image's pixels may read after a refresh."""
        return self.current.feedback()

    def limit_means(self) -> None:
        """See Reconstruction."""
        self.current.limit_means()

    def clear(self) -> None:
        """Forget every sample."""
        self.current.clear()

    @property
    def at_rest(self) -> bool:
        """Whether a finer image would go on from what this one shows, see rescale."""
        return self.current.at_rest

    @property
    def nothing_moves(self) -> bool:
        """Whether the last refresh showed the same event as the one before."""
        return self.current.nothing_moves

    @property
    def count(self) -> int:
        """Samples stored."""
        return self.current.count

    @property
    def bytes(self) -> int:
        """Memory of all its arrays."""
        return sum(made.bytes for made in self._made.values())

    def take_dirty(self) -> NDArray[np.bool_]:
        """(rows, columns) bool of the panel's 16-pixel tiles changed since the last call."""
        dirty = self.current.take_dirty()
        rescaled, self._rescaled = self._rescaled, False
        return (self._enlarger().tiles(dirty) if self.scale > 1 else dirty) | rescaled

    def display(self, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8], *, tone: Tone = AS_IT_IS) -> None:
        """Redo the dirty tiles of `rgb` (h, w, 3) uint8, sRGB, exposed and mapped."""
        if self.scale == 1:
            self.current.display(dirty, rgb, tone=tone)
            return
        enlarger, everything = self._enlarger(), np.ones_like(self.current.buffer.history.dirty)
        update_display(self.current.radiance, everything, TILE, enlarger.codes, tone=tone)

        def update(top: int, bottom: int) -> None:
            enlarger.display(dirty, rgb, top, bottom)

        self._threads.share(self.rect.height, update, unit=TILE)

    @property
    def radiance(self) -> Float32:
        """(h, w, 3) float32 linear RGB of the panel."""
        if self.scale == 1:
            return self.current.radiance
        return self._enlarger().enlarged(self.current.radiance)

    def stored(self) -> StoredSamples:
        """The samples of the image, where they show on the panel."""
        stored = self.current.stored()
        if self.scale == 1:
            return stored
        screen = stored.screen_position.copy()
        screen[:2] /= self._ratio()[:, None]
        return stored._replace(screen_position=screen)

    def block_weights(self) -> Float32:
        """(h / 4, w / 4) float32, rounded up: weight of the samples that show in each 4x4 pixels, a pixel's up to 1."""
        return self._spread(self.current.block_weights(), 4)

    def accumulated_counts(self) -> Float32:
        """(h, w) float32: of how many samples each pixel shows the mean while nothing moves."""
        return self._spread(self.current.accumulated_counts(), 1)

    def _spread(self, values: Float32, edge: int) -> Float32:
        """Values of squares of the image, `edge` pixels each, for squares of as many pixels of the panel."""
        if self.scale == 1:
            return values
        rows, columns = -(-self.rect.height // edge), -(-self.rect.width // edge)
        i = np.arange(rows) * len(values) // rows
        spread: Float32 = values[i[:, None], np.arange(columns) * values.shape[1] // columns]
        return spread

    def _enlarger(self) -> Enlarged:
        small = self.current.rect
        if self._enlarged is None or self._enlarged.small != small:
            self._enlarged = Enlarged(small, self.rect)
        return self._enlarged


class Enlarged:
    """An image of fewer pixels, brought to those of its panel: each pixel between those around its centre."""

    def __init__(self, small: Rect, large: Rect) -> None:
        self.small, self._large = small, large
        self.codes: NDArray[np.uint8] = np.zeros((small.height, small.width, 3), np.uint8)  # what `display` shows
        self._down, self._across = CubicAxis(small.height, large.height), CubicAxis(small.width, large.width)
        self._linear = Axis(small.height, large.height), Axis(small.width, large.width)
        self._dirty = np.zeros((len(self._down.first_tile), len(self._across.first_tile)), np.bool_)

    def compile(self) -> None:
        """Compile what is called for every image: none is to wait for it."""
        rgb = np.zeros((self._large.height, self._large.width, 3), np.uint8)
        self.display(self.tiles(np.zeros((1, 1), np.bool_)), rgb, 0, self._large.height)
        self.as_shown(np.zeros((self.small.height, self.small.width, 3), np.float32))

    def tiles(self, dirty: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(rows, columns) bool, tiles of the large image that take from dirty ones of the small image."""
        down, across = self._down, self._across
        kernels.enlarged_tiles(dirty, down.first_tile, down.last_tile, across.first_tile, across.last_tile, self._dirty)
        return self._dirty

    def display(self, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8], top: int, bottom: int) -> None:
        """Enlarge `codes` to the dirty tiles of `rgb` (h, w, 3), in its rows top to bottom - 1, whole tiles."""
        down, across = self._down, self._across
        kernels.enlarge_codes(
            self.codes, down.pixels[top:bottom], down.weights[top:bottom], across.pixels, across.weights,
            dirty[top // TILE : -(-bottom // TILE)], rgb[top:bottom],
        )  # fmt: skip

    def as_shown(self, radiance: Float32) -> Float32:
        """(h, w, 3) float32 linear RGB of the large image as `display` enlarges it, but for rounding, and curves."""
        light: Float32 = np.zeros((self._large.height, self._large.width, 3), np.float32)
        down, across = self._down, self._across
        kernels.enlarge_light(np.sqrt(radiance), down.pixels, down.weights, across.pixels, across.weights, light)
        return light

    def enlarged(self, radiance: Float32) -> Float32:
        """(h, w, 3) float32 linear RGB of the large image, bilinear."""
        light: Float32 = np.zeros((self._large.height, self._large.width, 3), np.float32)
        (down, across), everywhere = self._linear, np.ones_like(self._dirty)
        kernels.interpolate(radiance, down.pixels, down.share, across.pixels, across.share, everywhere, light)
        return light


def inside(xy: Float32, rect: Rect) -> Float32:
    """Positions, (n, 2) float32, that rounding may have brought to the far edges of an image, inside it."""
    last = np.nextafter(np.array([rect.width, rect.height], np.float32), np.float32(0.0))
    placed: Float32 = np.minimum(xy.astype(np.float32), last)
    return placed
