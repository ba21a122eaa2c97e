"""Everything on the wire that is not samples: events, signs of life, stop, framelets.

Each message is a header (magic, version, kind, length, CRC-32) and a body: fixed structs for events and framelets, JSON
with checked types for the rest, which is rare. Plain pixels of a framelet are not in its checksum. parse_control()
gives a message or raises RemoteProtocolError; what serialise() refuses is what parse_control() would refuse.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

from wall.core.data import Event, StatisticsImage
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.core.tone_mapping import TONE_MAPPINGS
from wall.packets.edits import edits_body, parse_edits
from wall.packets.framelets import HEAD as PART_HEAD
from wall.packets.framelets import FrameletPart, camera_of, is_plain, parse_part, part_head, pose_numbers
from wall.packets.joining import JoinAnswer, JoinRequest, Leave
from wall.packets.json_body import checked, json_body
from wall.packets.notes import LEVELS, Note
from wall.packets.samples import MAX_NUMBER as MAX_EVENT
from wall.packets.statistics_image import parse_statistics_image, statistics_image_body

MAGIC, VERSION = b"WALL", 20
KIND_EVENT, KIND_FRAMELET, KIND_HELLO, KIND_HEARTBEAT, KIND_PING, KIND_PONG, KIND_STOP = range(2, 9)
KIND_STATISTICS_IMAGE, KIND_WINDOW_INPUT, KIND_STATISTICS, KIND_MEMBERSHIP = 10, 11, 12, 13  # 9 is not used
KIND_EDIT_REQUEST, KIND_EDIT_ANSWER, KIND_SELECTION, KIND_ASSIGNMENT = 14, 15, 16, 17
KIND_PREPARE, KIND_PREPARED, KIND_ADOPT, KIND_NOTE, KIND_JOIN_REQUEST, KIND_JOIN_ANSWER, KIND_LEAVE = range(18, 25)
KIND_ALIVE = 25
MAX_TEXT_BYTES = 16384  # of a JSON body
MAX_MEMBERSHIP_BYTES = 1 << 17  # of that of a Membership: a thousand ranks
MAX_ANSWER_BYTES = 1 << 22  # of that of an EditAnswer: some ten thousand parameters; of a JoinAnswer
MAX_CONFIGURATION_BYTES = 1 << 20  # of that of a message with the text of a configuration
ALL_BUT_OBJECTS = ""  # a pattern of parameters' names
_HEADER = struct.Struct("<4sBBxxI")
_CHECKSUM = struct.Struct("<I")
HEADER_BYTES = _HEADER.size + _CHECKSUM.size
KIND_AT = 5  # byte of the header
_EVENT = struct.Struct("<HQQdd3d9d3fB31p31pBdBQ")  # then the edits


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """A rank of the run: what it says until the membership lists it."""

    rank: int
    host: str
    endpoint: str  # where other ranks connect to; "" where none does
    incarnation: int  # differs each time that the rank is started
    key: str = ""  # CURVE, of one that has joined; "": of the start, or none
    page: str = ""  # address of the page that it serves, with the token
    watch: str = ""  # likewise, with the token of those who only watch

    def without_page(self) -> Hello:
        """What other ranks get to know."""
        return replace(self, page="", watch="")


@dataclass(frozen=True, slots=True, kw_only=True)
class Membership:
    """The Hello of every rank in the run. Absolute, and repeated: the newest replaces all before it."""

    members: tuple[Hello, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """Which strip of the wall each renderer renders from now on. Absolute, and repeated: the newest replaces others."""

    number: int  # counts them; 0 is the configuration's
    cuts: list[int] = field(default_factory=list)  # see geometry.strips; a strip a renderer


@dataclass(frozen=True, slots=True, kw_only=True)
class Heartbeat:
    """A rank lives, and what it has done so far."""

    rank: int
    time: float  # seconds of the head's clock
    samples_traced: int = 0
    samples_shown: int = 0
    secondary_rays: int = 0
    samples_per_s: float = 0.0  # lately
    compared_per_s: float = 0.0  # of them by the sampler that is compared
    bytes_per_s: float = 0.0
    refreshes_per_s: float = 0.0  # lately, of images made here
    packets: int = 0
    bytes: int = 0
    seconds: float = 0.0  # since it began
    process: int = 0  # its number on its host
    memory: int = 0  # bytes, now
    peak_memory: int = 0  # bytes
    right_s: float = 0.0  # from an input until the images made here are right in 90 % of their pixels; 0: not known
    cpu_seconds: float = 0.0  # of its process, all threads, since its loop began
    credit: int = -1  # bytes that it may send now, to the rank to which it may send least; below 0: it sends none
    dropped: dict[str, int] = field(default_factory=dict)
    samples_per_pixel: int = 0  # of the progressive sampler's stage that is shown; 0: none is
    square_error: float = 0.0  # estimate of its mean squared error, display codes of 8 bits; 0: not known
    complete: bool = False  # nothing left to do under the event below
    oldest_sample_at: float = -1.0  # seconds of the head's clock, of a renderer's own image; below 0: none in a pixel
    camera_event: int = -1
    scene_event: int = -1
    last: bool = False  # its last word
    answers: list[float] = field(default_factory=list)  # of a renderer's last word: Work.answers, seconds
    samples_of: dict[str, int] = field(default_factory=dict)  # by view: samples traced
    time_of: dict[str, int] = field(default_factory=dict)  # by view: microseconds of a renderer, tracing and images
    refreshes_of: dict[str, int] = field(default_factory=dict)  # by view: refreshes of images that this rank makes
    assignment: int = 0  # number of the Assignment that this renderer follows
    configuration: int = 0  # number of the configuration that this rank has adopted
    costs: dict[str, int] = field(default_factory=dict)  # by layer: of its region, in any unit; {}: not measured yet
    updates_shown: int = 0  # of the scene, in images that this renderer makes
    updates_shared: int = 0  # of them, those that several of its views have shown
    works: bool = False  # a renderer: there is something to trace
    busy_s: float = 0.0  # since its loop said this: the manager adds what Alive says


@dataclass(frozen=True, slots=True, kw_only=True)
class Alive:
    """A rank lives whose loop is held up, by a batch, a refresh or a compiler: all is as its last Heartbeat said."""

    rank: int
    time: float  # seconds of the head's clock
    busy_s: float  # since its last Heartbeat, as long as its process ran


@dataclass(frozen=True, slots=True, kw_only=True)
class Ping:
    """A rank asks for the head's time."""

    sent: float  # the sender's own monotonic clock


@dataclass(frozen=True, slots=True, kw_only=True)
class Pong:
    """The answer to a Ping."""

    sent: float  # as it came
    head_time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """The run ends."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowInput:
    """Input at a compositor's windows or page since its last message: steering commands, and how the run was ended."""

    rank: int
    commands: list[Any] = field(default_factory=list)  # as a page sends them, unchecked; at most MAX_COMMANDS
    escape: str = ""  # where Escape was pressed, in words; it ends the run
    closed: bool = False  # no window of that rank is left


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """How the run is doing, for overlays away from the head, which have a placeholder for each."""

    fps: float
    samples_per_s: float
    latency_ms: float
    ranks: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """To compositors that report: what pages share beside the scene. Absolute: the newest replaces all before it."""

    names: list[str] = field(default_factory=list)  # by view: of the object that is selected, "" none; []: none is
    bookmarks: list[int] = field(default_factory=list)  # of cameras, that can be recalled


@dataclass(frozen=True, slots=True, kw_only=True)
class EditRequest:
    """Another process or a viewer of a page wants parameters changed, all of them or none, or listed, or steers."""

    client: int  # a number of its own, above all ranks
    number: int  # of the client's requests: one that comes again is answered again, and not done again
    key: str  # the run's, from its control file
    assignments: list[Any] = field(default_factory=list)  # [name path, value]; at most MAX_COMMANDS
    listed: list[Any] = field(default_factory=list)  # patterns, or ALL_BUT_OBJECTS: the parameters of the answer
    undo: int = 0  # edits that are to be taken back, the newest first
    configuration: str = ""  # YAML that the run is to adopt; "": none
    path: str = ""  # of its file: relative paths start at the file's folder; "": of the run's
    commands: list[Any] = field(default_factory=list)  # as of a WindowInput, whose `view` may be a name
    changes: list[Any] = field(default_factory=list)  # of the run's own configuration, see roles.config_edits


@dataclass(frozen=True, slots=True, kw_only=True)
class EditAnswer:
    """What the manager has done with an EditRequest."""

    client: int  # as they came
    number: int
    refused: str  # why nothing was changed; "" where all was
    edit: int  # number of the newest edits
    parameters: list[dict[str, Any]] = field(default_factory=list)
    left_out: int = 0  # parameters that were asked for and have no room


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepare:
    """Make everything that a configuration needs, beside what runs. Repeated until Prepared answers."""

    number: int  # counts the configurations of a run; 0 is the one that it began with
    text: str  # YAML
    path: str  # of its file


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A rank has made what a configuration needs, or cannot."""

    rank: int
    number: int
    refused: str = ""  # why it cannot


@dataclass(frozen=True, slots=True, kw_only=True)
class Adopt:
    """From now on the run is of this configuration. Repeated until every heartbeat says so."""

    number: int
    since: int  # its first camera event, of every view: packets of earlier ones are of what ran before


Message: TypeAlias = (
    Event | FrameletPart | Hello | Heartbeat | Alive | Membership | Ping | Pong | Statistics | StatisticsImage
    | Stop | WindowInput | EditRequest | EditAnswer | Selection | Assignment | Prepare | Prepared | Adopt | Note
    | JoinRequest | JoinAnswer | Leave
)  # fmt: skip
_JSON_KINDS: dict[int, type[Any]] = {
    KIND_HELLO: Hello,
    KIND_HEARTBEAT: Heartbeat,
    KIND_PING: Ping,
    KIND_PONG: Pong,
    KIND_STOP: Stop,
    KIND_WINDOW_INPUT: WindowInput,
    KIND_STATISTICS: Statistics,
    KIND_MEMBERSHIP: Membership,
    KIND_EDIT_REQUEST: EditRequest,
    KIND_EDIT_ANSWER: EditAnswer,
    KIND_SELECTION: Selection,
    KIND_ASSIGNMENT: Assignment,
    KIND_PREPARE: Prepare,
    KIND_PREPARED: Prepared,
    KIND_ADOPT: Adopt,
    KIND_NOTE: Note,
    KIND_JOIN_REQUEST: JoinRequest,
    KIND_JOIN_ANSWER: JoinAnswer,
    KIND_LEAVE: Leave,
    KIND_ALIVE: Alive,
}
_MAX_BYTES: dict[type[Any], int] = {
    Membership: MAX_MEMBERSHIP_BYTES,
    EditAnswer: MAX_ANSWER_BYTES,
    JoinAnswer: MAX_ANSWER_BYTES,
    EditRequest: MAX_CONFIGURATION_BYTES,
    Prepare: MAX_CONFIGURATION_BYTES,
}
_NOT_BELOW_0 = ["samples_per_s", "compared_per_s", "bytes_per_s", "seconds", "cpu_seconds", "square_error"]
_NOT_BELOW_0 += ["refreshes_per_s", "right_s", "busy_s"]


def serialise(message: Message) -> bytes:
    """The bytes of a message. Raises LocalProtocolError where it does not fit the format."""
    name = type(message).__name__
    try:
        kind, body = _body(message)
        data = message.data if isinstance(message, FrameletPart) else b""
        _parse_body(kind, body, data)  # they are small and rare; a framelet's data is not looked into
    except (struct.error, ValueError, RemoteProtocolError) as error:
        raise LocalProtocolError(f"{name} does not fit its message: {error}") from error
    head = _HEADER.pack(MAGIC, VERSION, kind, len(body) + len(data))
    return b"".join((head, _CHECKSUM.pack(_checksum(head, kind, body, data)), body, data))


def parse_control(data: bytes | memoryview) -> Message:
    """The message of some bytes. Raises RemoteProtocolError for anything else."""
    if len(data) < HEADER_BYTES:
        raise RemoteProtocolError(f"a message of {len(data)} bytes; its header alone has {HEADER_BYTES}")
    magic, version, kind, length = _HEADER.unpack_from(data)
    (checksum,) = _CHECKSUM.unpack_from(data, _HEADER.size)
    end = HEADER_BYTES + PART_HEAD.size if kind == KIND_FRAMELET else len(data)
    body, rest = bytes(data[HEADER_BYTES:end]), memoryview(data)[end:]
    if magic != MAGIC or version != VERSION:
        raise RemoteProtocolError(f"not a message of version {VERSION}: starts with {bytes(data[:6])!r}")
    came = len(body) + len(rest)
    if length != came or _checksum(data[: _HEADER.size], kind, body, rest) != checksum:
        raise RemoteProtocolError(f"message of kind {kind}: {came} bytes of {length}, or a checksum that differs")
    return _parse_body(kind, body, rest)


def maker_of(data: bytes, ranks: Sequence[int]) -> int | None:
    """The rank whose a framelet or a renderer's statistics image is; `ranks`: of the graph's steps.

    None for other messages, and for what names no step, or is too short: parse_control() refuses it.
    """
    if len(data) < HEADER_BYTES + 2 or data[: len(MAGIC)] != MAGIC:
        return None
    kind, number = data[KIND_AT], int.from_bytes(data[HEADER_BYTES : HEADER_BYTES + 2], "little")
    if kind == KIND_STATISTICS_IMAGE:
        return number or None  # 0: of a compositor, for the head, which does not say whose it is
    return ranks[number] if kind == KIND_FRAMELET and number < len(ranks) else None


def _checksum(head: bytes | memoryview, kind: int, body: bytes, data: bytes | memoryview) -> int:
    checksum = zlib.crc32(body, zlib.crc32(head))
    return checksum if kind == KIND_FRAMELET and is_plain(body) else zlib.crc32(data, checksum)


def _body(message: Message) -> tuple[int, bytes]:
    if isinstance(message, Event):
        return KIND_EVENT, _event_body(message)
    if isinstance(message, StatisticsImage):
        return KIND_STATISTICS_IMAGE, statistics_image_body(message)
    if isinstance(message, FrameletPart):
        return KIND_FRAMELET, part_head(message)
    kind = next(number for number, cls in _JSON_KINDS.items() if isinstance(message, cls))
    return kind, json_body(message)


def _parse_body(kind: int, body: bytes, data: bytes | memoryview) -> Message:
    """`data`: of a framelet, behind its head; of others none."""
    if kind == KIND_FRAMELET:
        return parse_part(body, data)
    if kind == KIND_EVENT:
        return _parse_event(body)
    if kind == KIND_STATISTICS_IMAGE:
        return parse_statistics_image(body)
    if kind in _JSON_KINDS:
        return _parse_json(_JSON_KINDS[kind], body)
    raise RemoteProtocolError(f"unknown kind of message {kind}")


def _event_body(event: Event) -> bytes:
    sampler, compare = event.sampler.encode(), event.compare.encode()
    if max(len(sampler), len(compare)) > 30:
        raise LocalProtocolError(f"sampler name {event.sampler!r} or {event.compare!r} is longer than 30 bytes")
    return _EVENT.pack(
        event.view, event.camera_event, event.scene_event, event.scene_time, event.input_time,
        *pose_numbers(event.camera), event.paused, sampler, compare,
        event.statistics, event.exposure, event.tone.code, event.edits.number,
    ) + edits_body(event.edits)  # fmt: skip


def _parse_event(body: bytes) -> Event:
    if len(body) < _EVENT.size:
        raise RemoteProtocolError(f"an event of {len(body)} bytes; it has at least {_EVENT.size}")
    *before, paused, sampler, compare, statistics, stops, mapping, edit = _EVENT.unpack_from(body)
    view, camera_event, scene_event, scene_time, input_time, *pose = before
    if not all(map(math.isfinite, (scene_time, input_time, stops, *pose))) or max(paused, statistics) > 1:
        raise RemoteProtocolError(
            f"event {camera_event}/{scene_event}: a number is not finite, or a flag is above 1: paused {paused}, "
            f"statistics {statistics}"
        )
    if max(camera_event, scene_event, edit) > MAX_EVENT:
        raise RemoteProtocolError(f"event {camera_event}/{scene_event}, edit {edit}: above {MAX_EVENT}")
    if mapping >= len(TONE_MAPPINGS):
        raise RemoteProtocolError(f"event {camera_event}/{scene_event}: no tone mapping has the number {mapping}")
    try:
        names = sampler.decode(), compare.decode()
    except UnicodeDecodeError as error:
        raise RemoteProtocolError(f"event {camera_event}/{scene_event}: sampler name is not text") from error
    return Event(
        view=view, camera_event=camera_event, scene_event=scene_event, scene_time=scene_time, input_time=input_time,
        camera=camera_of(pose), sampler=names[0], paused=bool(paused),
        compare=names[1], statistics=bool(statistics), exposure=stops, tone_mapping=TONE_MAPPINGS[mapping],
        edits=parse_edits(edit, body[_EVENT.size :]),
    )  # fmt: skip


def _parse_json(cls: Any, body: bytes) -> Message:
    """A message whose JSON has exactly its fields, of their types; numbers finite."""
    name = cls.__name__
    limit = _MAX_BYTES.get(cls, MAX_TEXT_BYTES)
    if len(body) > limit:
        raise RemoteProtocolError(f"a {name} of {len(body)} bytes; at most {limit}")
    try:
        values = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise RemoteProtocolError(f"a {name} that is not JSON ({error})") from error
    if cls is Membership and isinstance(values, dict) and isinstance(values.get("members"), list):
        values["members"] = tuple(checked(Hello, member) for member in values["members"])
    message: Message = checked(cls, values)
    below = [field for field in _NOT_BELOW_0 if getattr(message, field, 0.0) < 0.0]
    if isinstance(message, Heartbeat | Alive) and below:
        raise RemoteProtocolError(f"a {name} of rank {message.rank} with {', '.join(below)} below 0")
    if isinstance(message, Note) and message.level not in LEVELS:
        raise RemoteProtocolError(f"a Note of level {message.level[:40]!r}; wanted one of {', '.join(LEVELS)}")
    return message
