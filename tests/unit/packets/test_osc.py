"""Trackers' packets: positions come out of messages and bundles of any kind of numbers, garbage is refused."""

from __future__ import annotations

import random
import struct

import pytest

from wall.core.errors import RemoteProtocolError
from wall.packets.osc import BUNDLE, MAX_BYTES, message_of, positions

HEAD = message_of("/head", (1.0, -2.5, 0.25))


def text(string: str) -> bytes:
    """A string as Open Sound Control 1.0 has it: NUL at the end, filled up to a multiple of 4."""
    data = string.encode() + b"\0"
    return data + bytes(-len(data) % 4)


def bundle(*messages: bytes) -> bytes:
    return BUNDLE + bytes(8) + b"".join(struct.pack(">i", len(each)) + each for each in messages)


def test_positions_of_one_message_and_of_a_bundle_come_in_their_order() -> None:
    other = message_of("/wand", (9.0, 9.0, 9.0))
    assert positions(HEAD, "/head", 0) == [(1.0, -2.5, 0.25)]
    assert positions(bundle(HEAD, other, message_of("/head", (0.0, 0.0, 1.0))), "/head", 0) == [
        (1.0, -2.5, 0.25),
        (0.0, 0.0, 1.0),
    ]
    assert positions(other, "/head", 0) == []


def test_numbers_of_any_kind_behind_texts_are_a_position() -> None:
    """Bytes by hand, from the specification: a number, a name, a truth, then x, y, z as double, int and int64."""
    told = text("/body") + text(",isTdih") + struct.pack(">i", 7) + text("head") + struct.pack(">diq", 1.5, -2, 3)

    assert positions(told, "/body", 3) == [(1.5, -2.0, 3.0)]


@pytest.mark.parametrize(
    "packet",
    [
        message_of("/head", (float("nan"), 0.0, 0.0)),
        message_of("/head", (0.0, float("inf"), 0.0)),
        text("/head") + text(",ff") + bytes(8),
        text("/head") + text(",fff") + bytes(8),
        text("/head") + text(",fsf") + bytes(12),
        text("/head") + text(",fbf") + bytes(12),
        text("/head") + text("fff") + bytes(12),
        HEAD[:-1],
        HEAD + bytes(MAX_BYTES),
        bundle(bundle(HEAD)),
        BUNDLE + bytes(8) + struct.pack(">i", 400) + HEAD,
        BUNDLE + bytes(8) + struct.pack(">i", 0) + HEAD,
        b"",
        b"\xff" * 32,
    ],
)
def test_what_tells_no_position_is_refused(packet: bytes) -> None:
    with pytest.raises(RemoteProtocolError, match="OSC"):
        positions(packet, "/head", 0)


def test_damaged_packets_are_refused_or_finite(caplog: pytest.LogCaptureFixture) -> None:
    dice, outcomes = random.Random(3), set()
    for _ in range(3000):
        data = bytearray(dice.choice((HEAD, bundle(HEAD, HEAD))))
        for _ in range(dice.randint(1, 4)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        try:
            found = positions(bytes(data[: dice.choice((len(data), dice.randrange(len(data))))]), "/head", 0)
            assert all(abs(number) < float("inf") for position in found for number in position)
            outcomes.add(bool(found))
        except RemoteProtocolError:
            outcomes.add("refused")
    assert outcomes == {True, False, "refused"}
    assert not caplog.records, "a stranger's packets fill no log"
