"""What a role is told, and what it asks for: the whole traffic between a role and the loop that executes it.

A role decides and does nothing else: it opens no socket, starts no thread and reads no clock. Its loop hands it
messages and the time, and carries out the instructions that it yields, each as soon as it is yielded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

from wall.core.data import Batch, Event, Region
from wall.display.base import Status, WallImage
from wall.packets.control import Message, Prepare
from wall.sampling.tiles import Measured

if TYPE_CHECKING:
    from wall.roles.plan import Plan

MANAGER = -1  # the address of the manager; other addresses are ranks
Ready: TypeAlias = Callable[[int], bool]  # whether a packet to a rank would be sent at once; False before Connect
Shares: TypeAlias = Callable[[int, int], bool]  # whether packets to a rank of so many bytes go through shared memory


def shares_nothing(to: int, size: int) -> bool:
    """No memory is shared with any rank."""
    return False


@dataclass(frozen=True, slots=True)
class Packet:
    """A packet came that was paid for with credit: samples, or a message of another compositor."""

    data: bytes


@dataclass(frozen=True, slots=True)
class Dropped:
    """A packet was not sent: it gave way to a newer one."""

    to: int
    packet: bytes


@dataclass(frozen=True, slots=True)
class Work:
    """What one worker has done since it began."""

    samples: int = 0
    compared: int = 0  # of those: by the second of two samplers
    secondary_rays: int = 0
    bad_samples: int = 0  # their radiance was not finite
    too_bright: int = 0  # more light than a packet carries; cut off there
    samples_per_pixel: int = 0  # of the progressive sampler's stage that is shown
    square_error: float = 0.0  # estimate of its mean squared error, display codes of 8 bits
    answers: tuple[float, ...] = ()  # seconds from the newest inputs until it began to trace for them
    demand: float = 0.0  # of its sampler: pixels, or for the adaptive one how many samples they ask for, to a factor


def total(work: Iterable[Work]) -> Work:
    """What several workers have done."""
    each = list(work)
    return Work(
        samples=sum(w.samples for w in each),
        compared=sum(w.compared for w in each),
        secondary_rays=sum(w.secondary_rays for w in each),
        bad_samples=sum(w.bad_samples for w in each),
        too_bright=sum(w.too_bright for w in each),
    )


@dataclass(frozen=True, slots=True)
class Traced:
    """A worker has finished a Trace."""

    worker: int
    event: Event  # of the Trace
    result: bytes | Batch | None  # a packet, or a batch to keep, empty: nothing to show yet; None: nothing is missing
    work: Work
    measured: Measured | None = None  # its sampler's tiles, where Trace asked for them
    seconds: float = 0.0  # that it took
    cpu_s: float = 0.0  # of its thread


@dataclass(frozen=True, slots=True)
class Presented:
    """The images of a Show have been given to their sinks."""

    wants_samples: bool = False  # whether a sink makes images of samples


@dataclass(frozen=True, slots=True)
class Died:
    """A rank's process has ended badly."""

    rank: int
    how: str
    again: bool = False  # whether it was started again


@dataclass(frozen=True, slots=True)
class Disconnected:
    """The connection by which a rank spoke has closed: its process has ended, or its host cannot be reached."""

    rank: int


@dataclass(frozen=True, slots=True)
class End:
    """Somebody wants the run to end."""

    reason: str


@dataclass(frozen=True, slots=True)
class PlanMade:
    """A Make is done."""

    number: int
    plan: Plan | None  # None: refused
    refused: str = ""  # why


@dataclass(frozen=True, slots=True)
class Changed:
    """A configuration's file has another text."""

    text: str
    path: str


@dataclass(frozen=True, slots=True)
class Invitation:
    """What processes need to be ranks of a configuration of this run."""

    number: int  # of the configuration
    told: str  # see JoinAnswer


@dataclass(frozen=True, slots=True)
class TrackerPacket:
    """A packet came from a tracker's machine."""

    port: int  # of ours, that it came to
    source: str  # IP address
    data: bytes
    time: float  # when it came, seconds of the head's clock


@dataclass(frozen=True, slots=True)
class TrackerStrangers:
    """Packets came to a tracker's port from machines that are no tracker's."""

    count: int


Input: TypeAlias = (
    TrackerPacket
    | TrackerStrangers
    | Message
    | Packet
    | Dropped
    | Traced
    | Presented
    | Died
    | Disconnected
    | End
    | PlanMade
    | Changed
    | Invitation
)


@dataclass(frozen=True, slots=True)
class Send:
    """Send a message. `to`: MANAGER; from the manager, a rank."""

    to: int
    message: Message


@dataclass(frozen=True, slots=True)
class Broadcast:
    """Send a message to every rank that has spoken."""

    message: Message


@dataclass(frozen=True, slots=True)
class Offer:
    """Send a packet to a compositor for credit; what has to give way to it comes back as Dropped."""

    to: int
    packet: bytes


@dataclass(frozen=True, slots=True)
class Connect:
    """Open a link to a rank, in place of an earlier one."""

    rank: int
    endpoint: str
    anew: bool = False  # another process is that rank now: it has nothing of what was sent before


@dataclass(frozen=True, slots=True)
class Admit:
    """From now on a rank is who proves this key, and nobody who has spoken as that rank before."""

    rank: int
    key: str  # "" where nothing is encrypted


@dataclass(frozen=True, slots=True)
class Trace:
    """Let an idle worker trace its next batch; Traced answers."""

    worker: int  # numbered through all regions of the rank
    event: Event
    lost: tuple[bytes, ...] = ()  # its packets that were dropped: their samples are to be traced again
    keep: bool = False  # the batch stays in this process: it is not encoded
    measure: bool = False  # tell what its sampler knows of its tiles


@dataclass(frozen=True, slots=True)
class Restart:
    """Make the samplers of a region's workers anew. Only while all of these are idle."""

    sampler: str
    compare: str
    depth: int | None = None  # most surfaces of the progressive sampler's paths; None: of direct light, or not wanted
    region: int = 0  # which of the rank's


@dataclass(frozen=True, slots=True)
class Reassign:
    """Trace these regions from now on; workers of those that were the rank's before stay. Only while all are idle."""

    regions: tuple[Region, ...]


@dataclass(frozen=True, slots=True)
class Show:
    """Give sinks their newest images, in the order of the graph; Presented answers."""

    images: tuple[WallImage, ...]
    status: Status


@dataclass(frozen=True, slots=True)
class Tell:
    """Give sinks that tell of the run its newest status at once, without an image."""

    status: Status


@dataclass(frozen=True, slots=True)
class Make:
    """Make a plan of a configuration beside what runs; PlanMade answers."""

    wanted: Prepare


@dataclass(frozen=True, slots=True)
class Finish:
    """End the loop. `failure`: why that is an error, "" where it is none."""

    failure: str = ""


Instruction: TypeAlias = (
    Send | Broadcast | Offer | Connect | Admit | Trace | Restart | Reassign | Show | Tell | Make | Finish
)
Instructions: TypeAlias = Iterable[Instruction]


class Role(Protocol):
    """What a loop executes."""

    due: float  # when `on_tick` is wanted next, seconds of the head's clock

    def on_message(self, message: Input, now: float) -> Instructions:
        """Take a message in."""
        ...

    def on_tick(self, now: float) -> Instructions:
        """Do what is due. Called after all messages that had come."""
        ...
