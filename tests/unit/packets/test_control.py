"""Control messages survive the wire exactly; what does not fit is refused on both sides."""

from __future__ import annotations

import json
import struct
import tracemalloc
import zlib
from dataclasses import replace
from typing import Any

import lz4.block
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wall.core.data import Camera, Event, Framelet, Rect
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets import control
from wall.packets.control import (
    Assignment,
    Heartbeat,
    Hello,
    Membership,
    Message,
    Ping,
    Pong,
    Selection,
    Statistics,
    Stop,
    WindowInput,
    parse_control,
    serialise,
)
from wall.packets.framelets import HEAD, FrameletPart
from wall.packets.joining import JoinAnswer, JoinRequest, Leave
from wall.packets.json_body import MAX_COMMANDS
from wall.packets.notes import Note, note_of

FINITE = st.floats(-1e15, 1e15)
RATE = st.floats(0.0, 1e15)
WORD, LONG, COUNT = st.integers(0, 65535), st.integers(0, 2**60 - 1), st.integers(0, 2**63 - 1)
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=50)
CAMERAS = st.builds(Camera, position=st.tuples(*[FINITE] * 3), world_from_wall=st.tuples(*[FINITE] * 9))
SAMPLERS = TEXT.filter(lambda name: len(name.encode()) <= 30)
EVENTS = st.builds(
    Event, view=WORD, camera_event=LONG, scene_event=LONG, scene_time=FINITE, input_time=FINITE, camera=CAMERAS,
    sampler=SAMPLERS, paused=st.booleans(), compare=SAMPLERS, statistics=st.booleans(),
)  # fmt: skip
HEARTBEATS = st.builds(
    Heartbeat, rank=WORD, time=FINITE, samples_traced=COUNT, samples_shown=COUNT, secondary_rays=COUNT,
    samples_per_s=RATE, compared_per_s=RATE, bytes_per_s=RATE, packets=COUNT, bytes=COUNT, seconds=RATE,
    memory=COUNT, refreshes_per_s=RATE, right_s=RATE, peak_memory=COUNT, cpu_seconds=RATE,
    dropped=st.dictionaries(TEXT, COUNT, max_size=64), complete=st.booleans(), camera_event=st.integers(-1, 2**60 - 1),
    scene_event=st.integers(-1, 2**60 - 1), last=st.booleans(),
)  # fmt: skip
HELLOS = st.builds(Hello, rank=WORD, host=TEXT, endpoint=TEXT, incarnation=COUNT)
MESSAGES = st.one_of(
    EVENTS, HEARTBEATS, HELLOS,
    st.builds(Membership, members=st.lists(HELLOS, max_size=3).map(tuple)),
    st.builds(WindowInput, rank=WORD, commands=st.lists(TEXT, max_size=3), escape=TEXT, closed=st.booleans()),
    st.builds(Statistics, fps=FINITE, samples_per_s=FINITE, latency_ms=FINITE, ranks=COUNT),
    st.builds(Ping, sent=FINITE), st.builds(Pong, sent=FINITE, head_time=FINITE), st.builds(Stop, reason=TEXT),
)  # fmt: skip
EVENT = Event(
    view=1, camera_event=7, scene_event=2, scene_time=2.5, input_time=100.125, sampler="hilbert", paused=True,
    compare="framed", statistics=True,
    camera=Camera(position=(1.0, 2.0, 3.0), world_from_wall=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
)  # fmt: skip
EXAMPLES: list[Message] = [
    EVENT,
    Hello(rank=1, host="node7", endpoint="tcp://10.0.0.7:4711", incarnation=4711),
    Membership(),
    Selection(),
    Selection(names=["urn", "", "pot 0"], bookmarks=[1, 9]),
    Assignment(number=0),
    Assignment(number=3, cuts=[0, 40, 128]),
    Note(rank=3, level="warning", text="no GPU\n\u00e4", replay={"batch": 117}),
    Membership(members=(Hello(rank=1, host="n", endpoint="tcp://a:1", incarnation=5),) * 2),
    Heartbeat(rank=1, time=2.0, dropped={"no_credit": 3}, last=True, answers=[0.25, 1.5]),
    Ping(sent=1.5),
    Statistics(fps=59.9, samples_per_s=1.25e6, latency_ms=12, ranks=4),
    Pong(sent=1.5, head_time=9.25),
    Stop(reason="time is up"),
    JoinRequest(client=1 << 32, number=2, key="k", host="node7", configuration=0, public="p"),
    JoinAnswer(client=1 << 32, number=2, rank=3, configuration=1, since=9, extra=2, told="{}"),
    Leave(rank=3),
    WindowInput(rank=2, commands=[{"kind": "pause"}], escape="Escape was pressed", closed=True),
]


def image(width: int, height: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.random.default_rng(width).integers(0, 9, (height, width, 3)).astype(np.uint8)


def framelet(width: int = 32, height: int = 16) -> FrameletPart:
    rect = Rect(x=16, y=48, width=width, height=height)
    return FrameletPart.of(2, Framelet(rect=rect, colour=image(width, height), refreshed_at=2.5), rect)


def pixels_of(data: bytes) -> np.ndarray[Any, np.dtype[np.uint8]]:
    came = parse_control(data)
    assert isinstance(came, FrameletPart)
    out = Framelet.blank(came.rect, came.channels, encoded=came.encoded)
    came.write(out)
    return out.colour


def sealed(kind: int, body: bytes) -> bytes:
    """A message with a header that fits its body, whatever that is."""
    head = struct.pack("<4sBBHI", b"WALL", control.VERSION, kind, 0, len(body))
    return head + struct.pack("<I", zlib.crc32(body, zlib.crc32(head))) + body


@given(message=MESSAGES)
@settings(max_examples=200, deadline=None)
def test_any_message_comes_back_equal(message: Message) -> None:
    assert parse_control(serialise(message)) == message


@pytest.mark.parametrize("size", [(1, 1), (32, 16), (480, 270)])
def test_a_framelet_s_pixels_come_back_exactly(size: tuple[int, int]) -> None:
    sent = serialise(framelet(*size))
    assert parse_control(sent) == framelet(*size)
    assert (pixels_of(sent) == image(*size)).all()


@pytest.mark.parametrize("message", [*EXAMPLES, framelet()], ids=lambda m: type(m).__name__)
def test_a_message_cut_anywhere_or_with_any_bit_flipped_is_refused(message: Message) -> None:
    data = serialise(message)
    for length in range(len(data)):
        with pytest.raises(RemoteProtocolError):
            parse_control(data[:length])
    for bit in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        with pytest.raises(RemoteProtocolError):
            parse_control(bytes(flipped))


@pytest.mark.parametrize(
    "wrong",
    [
        replace(EVENT, view=65536), replace(EVENT, camera_event=-1), replace(EVENT, scene_time=float("nan")),
        replace(EVENT, sampler="s" * 31), replace(EVENT, sampler="\ud800"),
        replace(EVENT, camera=replace(EVENT.camera, position=(0.0, float("inf"), 0.0))),
        Ping(sent=float("inf")), Ping(sent=True), Stop(reason="\ud800"), Stop(reason="r" * 20000),
        Hello(rank=-2, host="", endpoint="", incarnation=1), Hello(rank=2**63, host="", endpoint="", incarnation=1),
        Note(rank=1, level="loud", text=""), Note(rank=1, level="info", text="", replay={"batch": 0.5}),
        Membership(members=(Hello(rank=1, host="\ud800", endpoint="", incarnation=1),)), Membership(members=(1,)),
        Heartbeat(rank=0, time=0.0, dropped={"a": -5}), Heartbeat(rank=0, time=0.0, samples_traced=1.5),  # type: ignore[arg-type]
        Heartbeat(rank=0, time=0.0, dropped={str(k): 1 for k in range(65)}),
        Heartbeat(rank=0, time=0.0, answers=[0.5] * 257), Heartbeat(rank=0, time=0.0, answers=["x"]),  # type: ignore[list-item]
        replace(framelet(), rect=Rect(x=0, y=0, width=0, height=16)),
        replace(framelet(), rect=Rect(x=0, y=0, width=1 << 32, height=1)),
        replace(framelet(), rect=Rect(x=1 << 25, y=0, width=1, height=1)),
        replace(framelet(), rect=Rect(x=0, y=0, width=16384, height=16384)),
        replace(framelet(), step=-1),
    ],
    ids=repr,
)  # fmt: skip
def test_what_would_be_refused_on_arrival_is_not_sent(wrong: Message) -> None:
    with pytest.raises(LocalProtocolError):
        serialise(wrong)


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "null", '{"sent": "1"}', '{"sent": true}', '{"sent": null}', '{"sent": 1, "more": 2}', "{}",
        '{"sent": NaN}', '{"sent": Infinity}', '{"sent": 1e400}', '{"sent": 1' + "0" * 400 + "}",
        '{"sent": 1' + "0" * 5000 + "}", "[" * 10000, '{"sent":' * 2000, '{"sent": 1}' + " " * 16384,
        "\0\0{", "\ufeff{}",
    ],
    ids=lambda text: text[:20],
)  # fmt: skip
def test_json_that_is_not_exactly_the_message_is_refused(text: str) -> None:
    with pytest.raises(RemoteProtocolError):
        parse_control(sealed(control.KIND_PING, text.encode()))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("rank", 1.0), ("rank", "1"), ("rank", True), ("rank", -2), ("rank", 2**63), ("complete", 1), ("time", "now"),
        ("dropped", []), ("dropped", {"a": 1.5}), ("dropped", {"a": {}}), ("dropped", {"\ud800": 1}),
        ("dropped", {str(k): 1 for k in range(65)}), ("samples_per_s", [1]),
    ],
)  # fmt: skip
def test_a_heartbeat_with_a_value_of_another_type_is_refused(key: str, value: Any) -> None:
    good = json.loads(serialise(Heartbeat(rank=1, time=2.0))[control.HEADER_BYTES :])
    with pytest.raises(RemoteProtocolError, match=f"a Heartbeat whose {key} is"):
        parse_control(sealed(control.KIND_HEARTBEAT, json.dumps(good | {key: value}).encode()))


@pytest.mark.parametrize("commands", ["[]", {}, None, [{}] * (MAX_COMMANDS + 1)], ids=lambda value: str(value)[:8])
def test_commands_that_are_not_a_short_list_are_refused(commands: Any) -> None:
    body = {"rank": 3, "commands": commands, "escape": "", "closed": False}
    with pytest.raises(RemoteProtocolError, match="a WindowInput whose commands is"):
        parse_control(sealed(control.KIND_WINDOW_INPUT, json.dumps(body).encode()))


@pytest.mark.parametrize("kind", [0, 1, 9, 255])
def test_an_unknown_kind_is_refused(kind: int) -> None:
    with pytest.raises(RemoteProtocolError, match=f"unknown kind of message {kind}"):
        parse_control(sealed(kind, b"{}"))


def test_any_value_of_any_event_byte_under_a_valid_checksum_is_refused_or_finite() -> None:
    body = serialise(EVENT)[control.HEADER_BYTES :]
    accepted = 0
    for offset in range(len(body)):
        for value in (0, 1, 2, 0x7F, 0x80, 0xF0, 0xFF):
            changed = body[:offset] + bytes([value]) + body[offset + 1 :]
            try:
                event = parse_control(sealed(control.KIND_EVENT, changed))
            except RemoteProtocolError:
                continue
            assert isinstance(event, Event)
            assert np.isfinite([event.scene_time, event.input_time, *event.camera.position]).all()
            assert np.isfinite(event.camera.world_from_wall).all()
            accepted += 1
    assert accepted > 100


def framelet_of(size: tuple[int, int], raw: bytes) -> bytes:
    """Display bytes that claim a rectangle of some size."""
    data = lz4.block.compress(raw, store_size=False)
    head = HEAD.pack(0, 0, 0, 0, *size, 1, 1, 0, 1, 0, 0, 0.0, 0.0, len(data), *[0.0] * 15)
    return sealed(control.KIND_FRAMELET, head + data)


def small_framelet_of(size: tuple[int, int]) -> bytes:
    """16 x 16 black pixels that claim another rectangle."""
    return framelet_of(size, bytes(16 * 16 * 3))


@pytest.mark.parametrize("size", [(0, 4), (4, 0), (65535, 65535), (1024, 1024)])
def test_a_framelet_too_small_for_its_rectangle_is_refused_before_it_is_expanded(size: tuple[int, int]) -> None:
    """No more than 255 bytes can come out of one lz4 byte, so small messages cannot ask for large buffers."""
    with pytest.raises(RemoteProtocolError, match="out of range"):
        parse_control(small_framelet_of(size))


@pytest.mark.parametrize("size", [(16, 15), (16, 17)])
def test_a_framelet_whose_data_is_another_rectangle_s_is_refused(size: tuple[int, int]) -> None:
    with pytest.raises(RemoteProtocolError, match="framelet of step 0"):
        pixels_of(small_framelet_of(size))


def test_a_framelet_bomb_never_takes_memory() -> None:
    came = parse_control(framelet_of((16, 16), bytes(1 << 28)))
    assert isinstance(came, FrameletPart)
    out = Framelet.blank(came.rect, came.channels, encoded=True)
    tracemalloc.start()
    try:
        with pytest.raises(RemoteProtocolError, match="does not decompress"):
            came.write(out)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "change",
    [{"samples_per_s": 1e300}, {"samples_per_s": -1.0}, {"seconds": -1.0}, {"square_error": -1e-9}, {"time": 1e16}],
    ids=str,
)
def test_a_heartbeat_of_what_cannot_be_is_refused(change: dict[str, float]) -> None:
    values = json.loads(serialise(Heartbeat(rank=1, time=2.0))[control.HEADER_BYTES :]) | change
    with pytest.raises(RemoteProtocolError, match="Heartbeat"):
        control._parse_body(control.KIND_HEARTBEAT, json.dumps(values).encode(), b"")


def test_a_note_of_any_text_can_be_sent_and_keeps_its_end() -> None:
    for text in ("\ud800" * 9, "\U0001f600" * 100_000, "short", "\x00\n" * 5000 + "the end"):
        told = parse_control(serialise(note_of(1, "error", text)))
        assert isinstance(told, Note)
        assert told.text[-7:] == text.encode(errors="replace").decode()[-7:]
