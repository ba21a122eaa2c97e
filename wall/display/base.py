"""The values that a sink receives, and its interface: show, close, dropped.

Frame: *virtual screen* pixels, origin at the top left corner of the wall, x right, y down; the gaps between
panels are their bezels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, StatisticsImage
from wall.core.tone_mapping import Tone

if TYPE_CHECKING:
    from wall.geometry.panels import Wall

# classes of latencies: half a refresh at 120 Hz to what nobody waits for
LATENCY_LIMITS_S = (0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelImage:
    """What one panel shows."""

    id: str
    rgb: NDArray[np.uint8]  # (h, w, 3) sRGB, never written again after it is handed over
    screen: tuple[int, int]  # x, y of its top left pixel in the virtual screen
    version: int  # grows whenever rgb changes
    span: tuple[int, int] | None = None  # width and height there; None: its pixels
    tiles: NDArray[np.int64] | None = None  # (rows, columns): the version in which each last changed; see tiles.py


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelSamples:
    """Samples that changed a panel since its image before: of each pixel the newest. The first are of every pixel."""

    panel: int  # index in WallImage.panels
    pixels: NDArray[np.int64]  # (n,) y * width + x, each once
    radiance: Float32  # (n, 3) linear RGB; what its pixel shows, where a sampler averages several samples
    tone: Tone  # of the image


@dataclass(frozen=True, slots=True, kw_only=True)
class HandlesPlace:
    """Where one viewport shows the object that is selected in its view, and the parameter that moves it."""

    view: int
    parameter: str
    value: tuple[float, float, float]  # under the event that is shown
    rect: tuple[int, int, int, int]  # x, y, width, height of the viewport on the virtual screen
    wall_from_object: tuple[float, ...]  # (12,) rows w, x w, y w of 3x4: from world units away from the object's middle
    # to virtual screen pixels x, y, up to a factor; w > 0 before the eye


@dataclass(frozen=True, slots=True, kw_only=True)
class Handles:
    """Where objects that are selected stand on the wall."""

    places: tuple[HandlesPlace, ...]  # of every viewport in whose view one is, the nearest last


@dataclass(frozen=True, slots=True, kw_only=True)
class WallImage:
    """What the whole wall shows at one display refresh."""

    width: int  # virtual screen pixels
    height: int
    panels: tuple[PanelImage, ...]
    time: float  # seconds of the head's clock
    camera_event: int
    scene_event: int
    scene_time: float = 0.0  # of that event, seconds
    compared: tuple[PanelImage, ...] = ()  # second images of the panels, while two samplers are compared
    statistics_images: tuple[StatisticsImage, ...] = ()  # while a viewer shows them; the same object until they change
    handles: Handles | None = None  # of what is selected; the same object until they change
    samples: tuple[PanelSamples, ...] = ()  # of every panel that has some, while a sink wants them; else it is left out


@dataclass(frozen=True, slots=True, kw_only=True)
class RankStatus:
    """One process of the run, as its row in the table shows it."""

    rank: int
    role: str  # "head", "compositor", "renderer", ...
    panel: str  # panel id; "" when it serves no single panel
    region: str  # what it renders, in words; "" when it renders nothing
    samples_per_s: float
    bytes_per_s: float
    oldest_sample_s: float | None  # age of the oldest displayed sample; None when it shows none
    dropped: int
    alive: bool
    memory_mb: float  # now
    busy_s: float = 0.0  # it is heard of, but one piece of work has held it up for so long


@dataclass(frozen=True, slots=True, kw_only=True)
class RankTotals:
    """What a process of the run has done since it was started, and what it has now."""

    host: str
    process: int = 0  # its number there; 0: not known
    seconds: float = 0.0  # since it was started
    silent_s: float = 0.0  # since it was last heard of
    samples: int = 0  # traced
    packets: int = 0  # sent
    bytes: int = 0  # of them
    refreshes: int = 0  # of images made here
    cpu_s: float = 0.0
    memory: int = 0  # bytes, now
    peak_memory: int = 0  # bytes
    credit: int = -1  # bytes that may be sent now where least may; below 0: it sends none
    dropped: Mapping[str, int] = field(default_factory=dict)  # by name


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterState:
    """A parameter and what it is now, as the command line and the page show it; see scene.parameters."""

    name: str  # name path
    kind: str
    low: float  # of each number
    high: float
    unit: str
    default: tuple[float, ...]  # the configuration's
    value: tuple[float, ...]
    choices: tuple[str, ...] = ()  # names of the numbers 0, 1, ... of a `choice`


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """How the run is doing; rates are over the last second or so."""

    seconds: float  # since the run began
    paused: bool
    sampler: str
    samplers: tuple[str, ...]  # what may be asked for
    ranks: tuple[RankStatus, ...]
    latency_ms: tuple[float, float, float]  # p50, p95, p99, input to changed image; 0: no input
    latencies_ms: tuple[float, ...]  # the recent ones, newest last, for the plot
    refreshes_per_s: float  # that changed something
    right_ms: float = 0.0  # input to images right in 90 % of their pixels, of the slowest rank; p50 or more; 0: unknown
    stale: tuple[tuple[float, float, float, float], ...] = ()  # x, y, width, height in virtual screen pixels of what
    # gets nothing new, since the ranks that make it are not heard of
    slow: str = ""  # why the wall is slower than wanted, and what to lower; "" if it is not
    compare: str = ""  # the sampler that has the other half of the rays; "" none
    compared_per_s: float = 0.0  # its samples, of those of all ranks
    samples_per_pixel: int = 0  # of the progressive sampler's stage that all of the wall shows; 0: none
    error: float = 0.0  # estimate of its RMS error, display codes of 8 bits; 0: not known
    parameters: tuple[ParameterState, ...] = ()  # that can be changed
    view_samplers: tuple[str, ...] = ()  # of every view
    view_paused: tuple[bool, ...] = ()  # of every view: whether its time stands still
    selected: tuple[str, ...] = ()  # of every view: the object that is, "" none; (): none is anywhere
    bookmarks: tuple[int, ...] = ()  # of cameras, that can be recalled
    notes: tuple[str, ...] = ()  # of ranks and of the run, the newest last
    totals: tuple[RankTotals, ...] = ()  # of every rank
    latency_counts: tuple[int, ...] = ()  # inputs so far, by latency: up to each of LATENCY_LIMITS_S, and above
    latency_sum_s: float = 0.0  # of all of them
    refreshes: float = 0.0  # of the whole wall so far


class Sink(Protocol):
    """Shows or stores images. Called by one thread."""

    def show(self, image: WallImage, status: Status) -> None:
        """Take the newest image. Called at most once a refresh, and only if something changed; must not block."""

    def close(self) -> None:
        """Finish writing, and close files, threads and sockets."""

    def dropped(self) -> dict[str, int]:
        """Counts of what was dropped so far, by name."""


@runtime_checkable
class Steered(Sink, Protocol):
    """A sink through which its viewers steer."""

    def commands(self) -> list[dict[str, Any]]:
        """What viewers asked for since the last call."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came of a command that brought an `id`."""

    refused: str = ""  # why nothing was changed; "" where all was
    edit: int = 0  # number of the newest edit
    parameters: Sequence[Mapping[str, Any]] = ()  # that were asked for
    left_out: int = 0  # of them, for which there is no room


@runtime_checkable
class Answers(Steered, Protocol):
    """A sink whose viewers wait for answers: some of its commands have an `id`."""

    def answer(self, number: int, answer: Answer) -> None:
        """Tell who asked what came of the command with this id. Any thread may call."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoomedPlace:
    """Where a node shows a part of a very large image, virtual screen pixels."""

    node: str
    x: int
    y: int
    width: int
    height: int
    fit: tuple[float, float]  # width and height of the whole image there at zoom 0


@runtime_checkable
class LaysOut(Sink, Protocol):
    """A sink that tells its viewers where panels and views are."""

    def lay_out(
        self, wall: Wall, views: Sequence[str], why_images: Sequence[str], images: Sequence[ZoomedPlace], folder: Path
    ) -> None:
        """Tell these from now on; the panels are those of before, their files lie in `folder`."""


class Choices(Protocol):
    """What viewers may show instead, by name."""

    names: tuple[str, ...]
    shown: str  # of them; "": none

    def load(self, name: str) -> tuple[str, str]:
        """The text of its configuration, and the path of its file. Raises EditError."""


@runtime_checkable
class Offers(Sink, Protocol):
    """A sink whose viewers may choose what is shown."""

    def offer(self, choices: Choices) -> None:
        """Offer these from now on. Any thread may call."""


@runtime_checkable
class TellsStatus(Sink, Protocol):
    """A sink that tells its viewers how the run is doing, and does not wait for an image to do so."""

    def tell(self, status: Status) -> None:
        """Tell what is newer than the newest image."""


@runtime_checkable
class TakesSamples(Sink, Protocol):
    """A sink that can make images of samples."""

    @property
    def wants_samples(self) -> bool:
        """Whether it wants WallImage.samples now."""
