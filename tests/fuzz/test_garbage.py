"""Seeded garbage: whatever comes, decode() and parse_control() give values or RemoteProtocolError."""

from __future__ import annotations

import contextlib
import os
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mutated_bytes import mutated
from packet_examples import CHECKSUM_AT, batch_of, check_sane, plain_samples, relightable_samples, resealed

from wall.core.data import CHANNELS, Batch, Camera, Event, Framelet, Rect, StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.geometry.steering import parse
from wall.packets.control import (
    KIND_FRAMELET,
    Heartbeat,
    Hello,
    Message,
    Ping,
    Statistics,
    WindowInput,
    parse_control,
    serialise,
)
from wall.packets.framelets import HEAD, FrameletPart, is_plain
from wall.packets.samples import Codec, decode, encode

Parsed = Batch | Message

ROUNDS = int(os.environ.get("WALL_FUZZ_ROUNDS", 4000))  # 16 inputs each
SEED = int(os.environ.get("WALL_FUZZ_SEED", 1))
RECT = Rect(x=3, y=4, width=40, height=30)
EVENT = Event(
    view=0, camera_event=7, scene_event=1, scene_time=2.0, input_time=3.0,
    camera=Camera(position=(1.0, 2.0, 3.0), world_from_wall=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
)  # fmt: skip


def framelet(*channels: str, encoded: bool, plain: bool = False) -> bytes:
    whole = Framelet.blank(RECT, frozenset({"colour", *channels}), encoded=encoded)
    whole.event = EVENT if channels else None
    return serialise(FrameletPart.of(2, whole, Rect(x=5, y=6, width=4, height=3), plain=plain))


CONTROL = [
    serialise(EVENT),
    serialise(Hello(rank=1, host="h", endpoint="tcp://h:1", incarnation=4)),
    serialise(Heartbeat(rank=1, time=2.0, dropped={"no_credit": 3})),
    serialise(Ping(sent=1.0)),
    serialise(Statistics(fps=59.9, samples_per_s=1.25e6, latency_ms=12, ranks=4)),
    serialise(WindowInput(rank=1, commands=[{"kind": "orbit", "x": 0.25, "y": -1e-3}], closed=True)),
    framelet(encoded=True),
    framelet("depth", "alpha", encoded=False),
    framelet(*CHANNELS, encoded=False),
    framelet(encoded=True, plain=True),
    framelet(*CHANNELS, encoded=False, plain=True),
    serialise(
        StatisticsImage(
            panel=1, compared=True, age=np.ones((2, 3), np.uint8), density=np.ones((2, 3), np.uint8),
            rects=np.ones((2, 4), np.uint16), error_reduction=np.ones(2, np.uint8),
        )
    ),
    serialise(
        StatisticsImage(
            rank=3, panel=1, compared=False, age=np.ones((0, 0), np.uint8), density=np.ones((0, 0), np.uint8),
            rects=np.ones((2, 4), np.uint16), error_reduction=np.ones(2, np.uint8),
        )
    ),
]  # fmt: skip
SAMPLES = [encode(batch_of(plain_samples(n)), codec) for n in (0, 1, 5) for codec in Codec]
FIELDS = [(True, False), (False, True), (False, False)]
FEWER = [
    encode(batch_of(plain_samples(n), depths=depths, objects=objects), codec)
    for n in (1, 5) for codec in Codec for depths, objects in FIELDS
]  # fmt: skip
COMPACT = [encode(batch_of(plain_samples(n), adaptive=True)) for n in (0, 1, 5, 40)]
RELIGHTABLE = [encode(batch_of(relightable_samples(n), adaptive=True, relightable=True)) for n in (0, 1, 5, 40)]
NOISY = [encode(batch_of(relightable_samples(n), adaptive=True, noisy=True)) for n in (0, 1, 5, 40)]


def resealed_control(data: bytes) -> bytes:
    body = data[16:]
    head = data[:8] + struct.pack("<I", len(body))
    plain = data[5:6] == bytes([KIND_FRAMELET]) and is_plain(body[: HEAD.size])
    covered = body[: HEAD.size] if plain else body
    return head + struct.pack("<I", zlib.crc32(covered, zlib.crc32(head))) + body


def survives(parse: Callable[[bytes], Parsed], data: bytes) -> bool:
    try:
        value = parse(data)
    except RemoteProtocolError:
        return False
    if isinstance(value, Batch):
        check_sane(value)
    elif isinstance(value, FrameletPart):
        with_pixels(value)
    elif isinstance(value, WindowInput):
        steered(value.commands)
    elif isinstance(value, StatisticsImage):
        assert value.age.shape == value.density.shape
        assert value.rects.shape == (len(value.error_reduction), 4)
        assert value.bounds.x >= 0
    return True


def steered(commands: list[Any]) -> None:
    """Each is a command within its limits, or refused."""
    for command in commands:
        with contextlib.suppress(RemoteProtocolError):
            came = parse(command)
            assert np.isfinite([came.x, came.y]).all()


def with_pixels(part: FrameletPart) -> None:
    """A part that was parsed fits a framelet of its own kind, or is refused; nothing outside of it is written."""
    if part.rect.area > 1 << 16:
        return
    out = Framelet.blank(part.rect, part.channels, encoded=part.encoded)
    with contextlib.suppress(RemoteProtocolError):
        part.write(out)
    beside = Framelet.blank(replace(part.rect, x=part.rect.x + 1), part.channels, encoded=part.encoded)
    with pytest.raises(RemoteProtocolError, match="wanted: inside"):
        part.write(beside)


@pytest.mark.parametrize("parse", [decode, parse_control])
def test_random_bytes_are_refused(parse: Callable[[bytes], Parsed]) -> None:
    rng = np.random.default_rng((SEED, 1))
    for _ in range(ROUNDS):
        data = rng.bytes(int(rng.integers(0, 200)))
        assert not survives(parse, data)
        assert not survives(parse, b"WALL\x01" + data)


@pytest.mark.parametrize(
    "packets",
    [SAMPLES, FEWER, COMPACT, RELIGHTABLE, NOISY],
    ids=["plain", "fewer_fields", "compact", "relightable", "noisy"],
)
def test_mutated_sample_packets_are_refused_or_harmless(packets: list[bytes]) -> None:
    rng, accepted = np.random.default_rng((SEED, 2)), 0
    for k in range(ROUNDS):
        data = mutated(rng, packets[k % len(packets)])
        survives(decode, data)
        if len(data) >= CHECKSUM_AT + 4:
            accepted += survives(decode, resealed(data))
    assert accepted > ROUNDS // 50


def test_mutated_control_messages_are_refused_or_harmless() -> None:
    rng, accepted = np.random.default_rng((SEED, 3)), 0
    for k in range(ROUNDS):
        data = mutated(rng, CONTROL[k % len(CONTROL)])
        survives(parse_control, data)
        accepted += survives(parse_control, resealed_control(data))
    assert accepted > ROUNDS // 50


def test_messages_of_one_kind_are_refused_by_the_other_parser() -> None:
    assert not any(survives(parse_control, data) for data in SAMPLES + FEWER + COMPACT + RELIGHTABLE + NOISY)
    assert not any(survives(decode, data) for data in CONTROL)
