"""Values that all layers share: samples, events, batches, rectangles, cameras, framelets.

Frames: *panel pixels* have their origin at the panel's top left corner, x right, y down, pixel (i, j) covers
[i, i+1) x [j, j+1). *World* is right-handed. Times are seconds of the head's monotonic clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.tone_mapping import Tone

Float32: TypeAlias = NDArray[np.float32]
Float64: TypeAlias = NDArray[np.float64]
Samples: TypeAlias = NDArray[np.void]
Channels: TypeAlias = frozenset[str]  # of CHANNELS

CHANNELS = ("colour", "depth", "alpha", "time", "object_id", "variance", "albedo", "normal")
TRIPLES: Channels = frozenset({"colour", "albedo", "normal"})  # have three numbers a pixel
BLANK: dict[str, tuple[float, Any]] = {  # what a channel holds where nothing is, and its type
    "depth": (np.inf, np.float32),
    "alpha": (0.0, np.float32),
    "time": (-np.inf, np.float32),
    "object_id": (0, np.uint32),
    "variance": (np.inf, np.float32),
    "albedo": (0.0, np.float32),
    "normal": (0.0, np.float32),
}

# Times of a framelet count from a multiple of this. Float32 steps by less than 4 us up to it. A sum of float32 and a
# multiple of a power of two is exact unless it needs a coarser step, so however often the origin moves, a time is off
# by one step of its age at most.
ORIGIN_STEP_S = 64.0

BACKGROUND = 0  # object id of rays that left the scene; object k of the scene has id k + 1

# The light visibility mask of a sample has 32 bits: the scene's directional lights first, then its point lights. A bit
# is set where nothing stands between the point and the light, also where the surface is turned away from it and where
# the scene has no such light. It is 0 where it is not known: such a sample keeps its radiance when lights move.
SAMPLE = np.dtype(
    [
        ("xy", np.float32, (2,)),  # panel pixels
        ("radiance", np.float32, (3,)),  # linear RGB, W sr^-1 m^-2
        ("depth", np.float32),  # distance from the eye along the ray, world units; inf = background
        ("time", np.float32),  # seconds after the batch's base time
        ("object_id", np.uint32),  # object id
        ("sqrt_irradiance", np.float32),  # of irradiance over pi: radiance over albedo; the sky's radiance; not sent
        (
            "normal",
            np.int8,
            (2,),
        ),  # of the surface, in the object's frame, octahedral; if light changes, and of paths
        ("light_visibility", np.uint32),  # light visibility mask, bit k: nothing hides light k from the point
        ("albedo", np.uint32),  # of paths: what radiance is divided by to be light, see core.kernels.albedo
        ("change", np.float32),  # 0..1, how much it contradicts what was shown at its pixel
    ]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rect:
    """A rectangle of panel pixels: [x, x + width) x [y, y + height)."""

    x: int
    y: int
    width: int
    height: int

    @property
    def area(self) -> int:
        """Number of pixels."""
        return self.width * self.height

    @property
    def right(self) -> int:
        """x just behind the last column."""
        return self.x + self.width

    @property
    def bottom(self) -> int:
        """y just behind the last row."""
        return self.y + self.height

    def contains(self, other: Rect) -> bool:
        """Whether this rectangle contains all of the other."""
        inside = self.x <= other.x and other.x + other.width <= self.x + self.width
        return inside and self.y <= other.y and other.y + other.height <= self.y + self.height

    def overlaps(self, other: Rect) -> bool:
        """Whether they have a pixel in common."""
        across = self.x < other.x + other.width and other.x < self.x + self.width
        return across and self.y < other.y + other.height and other.y < self.y + self.height

    def intersection(self, other: Rect) -> Rect | None:
        """Their common pixels; None if there are none."""
        x, y = max(self.x, other.x), max(self.y, other.y)
        right, bottom = min(self.right, other.right), min(self.bottom, other.bottom)
        return Rect(x=x, y=y, width=right - x, height=bottom - y) if right > x and bottom > y else None

    def join(self, other: Rect) -> Rect:
        """The smallest that holds both."""
        x, y = min(self.x, other.x), min(self.y, other.y)
        right, bottom = max(self.right, other.right), max(self.bottom, other.bottom)
        return Rect(x=x, y=y, width=right - x, height=bottom - y)

    def minus(self, taken: Rect) -> tuple[Rect, ...]:
        """What is left of it without the other: at most four rectangles that do not overlap."""
        common = self.intersection(taken)
        if common is None:
            return (self,)
        parts = (
            (self.x, self.y, self.width, common.y - self.y),
            (self.x, common.bottom, self.width, self.bottom - common.bottom),
            (self.x, common.y, common.x - self.x, common.height),
            (common.right, common.y, self.right - common.right, common.height),
        )
        return tuple(Rect(x=x, y=y, width=w, height=h) for x, y, w, h in parts if w > 0 and h > 0)

    @property
    def numbers(self) -> tuple[int, int, int, int]:
        """x, y, width, height, as kernels take them."""
        return self.x, self.y, self.width, self.height

    def inside(self, other: Rect) -> tuple[slice, slice]:
        """Rows and columns of an array that covers `other` which this part of it takes."""
        y, x = self.y - other.y, self.x - other.x
        return slice(y, y + self.height), slice(x, x + self.width)


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """The part of a view that one rank renders: a rectangle of one panel."""

    panel: int  # index in Wall.traced
    rect: Rect
    layer: int = 0  # index in Graph.layers
    view: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """Where the eye is, and how the wall's frame is turned in the world.

    A wall-frame direction d (x right, y up, -z into the wall) points to `world_from_wall @ d` in the world.
    """

    position: tuple[float, float, float]  # world units, float64
    world_from_wall: tuple[float, ...]  # 9 numbers, row major rotation
    eye: tuple[float, float, float] = (0.0, 0.0, 0.0)  # from the view's own eye to where a tracker has it, metres,
    # wall frame, numbers that float32 holds; `position` is where it really is

    @classmethod
    def of(cls, position: Float64, rotation: Float64) -> Camera:
        """The camera at a position (3,), world units, with world_from_wall as a (3, 3) array."""
        x, y, z = position.tolist()
        return cls(position=(x, y, z), world_from_wall=tuple(rotation.ravel().tolist()))

    def rotation(self) -> Float64:
        """(3, 3) world_from_wall."""
        return np.array(self.world_from_wall, dtype=np.float64).reshape(3, 3)

    def origin(self) -> Float64:
        """(3,) the eye's position, world units."""
        return np.array(self.position, dtype=np.float64)

    def tracked(self, eye: tuple[float, float, float], scale: float) -> Camera:
        """This camera seen by an eye elsewhere before the same wall; the same object where that is where it is.

        `eye`: from the view's own, metres, wall frame, rounded to float32; `scale`: world units a metre of the wall.
        """
        if eye == self.eye:  # skips the rounding
            return self
        x, y, z = np.array(eye, np.float32).tolist()
        if (x, y, z) == self.eye:
            return self
        shift = scale * (np.array((x, y, z)) - np.array(self.eye))
        position = tuple((self.origin() + self.rotation() @ shift).tolist())
        return replace(self, position=position, eye=(x, y, z))


MOST_SAMPLES = "sampling.samples_per_pixel"  # the parameter that no sample depends on


@dataclass(frozen=True, slots=True)
class Edits:
    """All edits of the scene since the run began, as a whole: values that replace those of the configuration.

    Edits of one number are the same. A batch that came as bytes holds the number alone; the receiver knows the values.
    """

    number: int = 0
    values: tuple[tuple[str, tuple[float, ...]], ...] = ()  # name path and numbers, by name; see scene.parameters

    @property
    def of_scene(self) -> tuple[tuple[str, tuple[float, ...]], ...]:
        """Those values on which samples depend, not only how many there are."""
        return tuple(each for each in self.values if each[0] != MOST_SAMPLES)

    def most_samples(self, otherwise: int) -> int:
        """Samples a pixel at which a sampler ends, where it does."""
        return next((int(numbers[0]) for name, numbers in self.values if name == MOST_SAMPLES), otherwise)


NO_EDITS = Edits()
STILL = Camera(position=(0.0, 0.0, 0.0), world_from_wall=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """The newest input: a numbered camera change and a numbered scene change of one view.

    Samples of two events with equal numbers are of the same image. `scene_time` fixes every animated object and light,
    and with `edits` how all is lit and what it looks like.
    """

    view: int
    camera_event: int
    scene_event: int
    scene_time: float  # seconds of the animation
    input_time: float  # when the input that caused it arrived, seconds of the head's clock
    camera: Camera
    sampler: str = ""  # sampling method asked for; "" keeps the configured one
    paused: bool = False
    compare: str = ""  # another method that gets half of the rays, for an image of its own; "" none
    statistics: bool = False  # a viewer shows an overlay: compositors make statistics images
    edits: Edits = NO_EDITS  # of the scene
    exposure: float = 0.0  # stops: light times 2^exposure is shown. Of the picture alone, no sample depends on it
    tone_mapping: str = "none"  # the curve of the picture, see core.tone_mapping

    @property
    def tone(self) -> Tone:
        """How the picture is exposed and mapped."""
        return Tone(self.exposure, self.tone_mapping)

    @property
    def number(self) -> tuple[int, int]:
        """Camera and scene event, which order events."""
        return (self.camera_event, self.scene_event)


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Samples of one rectangle, traced under one event: what a packet carries."""

    view: int
    panel: int  # index in Wall.traced
    rect: Rect  # of panel pixels; every sample lies inside
    rank: int
    sequence: int  # counts this rank's batches
    camera_event: int
    scene_event: int
    base_time: float  # seconds of the head's clock
    samples: Samples  # (n,) SAMPLE
    frame: int = 0  # 0: show at once; k > 0: belongs to double-buffered frame k
    frame_samples: int = 0  # with frame > 0: how many samples, kept or skipped, make that frame complete
    skipped: int = 0  # samples traced for this batch but left out, their radiance not being finite
    blend: float = 1.0  # weight of a new sample against the image before it; 1 replaces
    camera: Camera = STILL  # that the samples saw
    scene_time: float = 0.0  # likewise, seconds of the animation
    adaptive: bool = False  # the image is made by reprojection; else every pixel shows its newest sample
    depths: bool = True  # samples bring their depth; adaptive ones always do
    objects: bool = True  # samples bring the object that they show; adaptive ones always do
    foreseen: bool = False  # not adaptive: traced where the camera was expected; samples of the event itself replace it
    relightable: bool = False  # adaptive samples bring normals and light visibility masks
    noisy: bool = False  # adaptive samples are of paths, and bring normals and albedos
    edits: Edits = NO_EDITS  # of the scene that the samples saw


@dataclass(frozen=True, slots=True, kw_only=True)
class StatisticsImage:
    """How old and how dense the samples of a panel are by tiles of 16 pixels, and the tiles that samplers go by.

    Codes are of reconstruction.statistics: 0 is none, the others are logarithmic. A renderer's image has the tiles of
    its own sampler alone: there age and density are (0, 0).
    """

    rank: int = 0  # the renderer whose tiles these are; 0: a compositor made it
    panel: int  # index in Wall.panels; of a renderer's tiles: in Wall.traced
    compared: bool  # of the second image, while two samplers are compared
    age: NDArray[np.uint8]  # (rows, columns) median age of the samples shown
    density: NDArray[np.uint8]  # (rows, columns) samples a pixel
    rects: NDArray[np.uint16]  # (n, 4) x, y, width, height, panel pixels
    error_reduction: NDArray[np.uint8]  # (n,) squared error that one more sample is expected to remove

    @property
    def bounds(self) -> Rect:
        """The smallest rectangle that holds every tile of `rects`, of which there is at least one."""
        corners, sizes = self.rects[:, :2].astype(int), self.rects[:, 2:]
        x, y = corners.min(axis=0).tolist()
        right, bottom = (corners + sizes).max(axis=0).tolist()
        return Rect(x=x, y=y, width=right - x, height=bottom - y)


@dataclass(slots=True, kw_only=True, eq=False)
class Framelet:
    """A partial image: a rectangle in a view's frame, an order, channels. What the compositing graph works on.

    The frame is the virtual screen's: pixels, origin top left. Channels that nobody needs are None.
    """

    rect: Rect
    colour: NDArray[Any]  # (h, w, 3) float32 linear RGB, times alpha where there is alpha; or uint8 sRGB, once encoded
    depth: Float32 | None = None  # (h, w) distance from the eye, world units; inf = background
    alpha: Float32 | None = None  # (h, w) 0..1
    time: Float32 | None = None  # (h, w) seconds after `time_origin`, when it was traced; -inf: nothing has come yet
    object_id: NDArray[np.uint32] | None = None  # (h, w) object id
    variance: Float32 | None = None  # (h, w) of the mean that colour is, linear, mean of the three channels
    albedo: Float32 | None = None  # (h, w, 3) mean share that what it shows reflects; 0 where that is not known
    normal: Float32 | None = None  # (h, w, 3) mean of normals, in the world's axes; 0 of the sky and where not known
    order: int = 0  # for ordered operators: the smaller is the nearer
    event: Event | None = None  # whose camera and scene time it shows; None: an image that knows none
    refreshed_at: float = 0.0  # when it was last brought up to date, seconds of the head's clock

    @classmethod
    def blank(cls, rect: Rect, channels: Channels, *, encoded: bool = False, order: int = 0) -> Framelet:
        """Black, infinitely far, opaque nowhere, never traced."""
        size = (rect.height, rect.width)
        made: dict[str, Any] = {
            name: np.full((*size, 3) if name in TRIPLES else size, *BLANK[name]) for name in channels - {"colour"}
        }
        colour = np.zeros((*size, 3), np.uint8 if encoded else np.float32)
        return cls(rect=rect, colour=colour, order=order, **made)

    @property
    def channels(self) -> Channels:
        """Names of the channels that it has."""
        return frozenset({"colour"} | {name for name in BLANK if getattr(self, name) is not None})

    @property
    def time_origin(self) -> float:
        """The zero of `time`, seconds of the head's clock: the last multiple of ORIGIN_STEP_S before `refreshed_at`."""
        return math.floor(self.refreshed_at / ORIGIN_STEP_S) * ORIGIN_STEP_S

    def stamp(self, now: float, *, except_for: Rect | None = None) -> None:
        """Set `refreshed_at`, and count `time` from the origin that goes with it; pixels in `except_for` do already."""
        before = self.time_origin
        self.refreshed_at = now
        if self.time is not None and self.time_origin != before:
            kept = self.time[except_for.inside(self.rect)].copy() if except_for is not None else None
            self.time += np.float32(before - self.time_origin)
            if except_for is not None:
                self.time[except_for.inside(self.rect)] = kept

    @property
    def encoded(self) -> bool:
        """Whether its colour is 8-bit sRGB already."""
        return self.colour.dtype == np.uint8

    def channel(self, name: str) -> NDArray[Any]:
        """One channel's array; KeyError if it has none of that name."""
        found: NDArray[Any] | None = getattr(self, name) if name in CHANNELS else None
        if found is None:
            raise KeyError(name)
        return found
