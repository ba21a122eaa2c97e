"""Numbers that are none in what ranks tell each other, and in the pixels that they send."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from wall.core.colour import srgb_curve
from wall.core.data import Event, Float32, Framelet, Rect
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.operators.kernels import pixels as kernels
from wall.packets.control import HEADER_BYTES, Heartbeat, Message, Ping, Statistics, parse_control, serialise
from wall.packets.framelets import FrameletPart
from wall.study.accuracy.case import Case, Found
from wall.study.accuracy.motion import START

NO_NUMBERS = (math.nan, math.inf, -math.inf)
EVENT = Event(view=0, camera_event=7, scene_event=1, scene_time=2.0, input_time=3.0, camera=START)
EDGE = 8  # pixels


def messages(step: int) -> Found:
    """Messages with a number that is none and that are taken: as they are made, and with each double of their bytes
    replaced, at every `step`-th byte.
    """
    wrong = [text for text, message in _broken() if _passes(message)]
    tried = 0
    for message in (EVENT, _part(_light())):
        data = serialise(message)
        parse_control(_resealed(data))  # as it is it is fine
        for at in range(HEADER_BYTES, min(len(data), HEADER_BYTES + 400) - 8, step):
            for value in NO_NUMBERS:
                tried += 1
                if _is_taken(_resealed(data[:at] + struct.pack("<d", value) + data[at + 8 :])):
                    wrong.append(f"{type(message).__name__} byte {at}: {value}")
    return Found(figure=len(wrong), note=f"of {tried} texts. " + "; ".join(wrong[:5]))


def _broken() -> Iterator[tuple[str, Message]]:
    """Messages of which one number is none."""
    for value in NO_NUMBERS:
        for name in ("scene_time", "input_time", "exposure"):
            yield f"event {name} {value}", replace(EVENT, **dict[str, Any]({name: value}))
        camera = replace(START, position=(0.0, value, 0.0))
        yield f"event position {value}", replace(EVENT, camera=camera)
        yield f"event eye {value}", replace(EVENT, camera=replace(START, eye=(value, 0.0, 0.0)))
        turned = (*START.world_from_wall[:8], value)
        yield f"event turn {value}", replace(EVENT, camera=replace(START, world_from_wall=turned))
        yield f"heartbeat {value}", Heartbeat(rank=1, time=value)
        yield f"ping {value}", Ping(sent=value)
        yield f"statistics {value}", Statistics(fps=value, samples_per_s=1.0, latency_ms=1.0, ranks=2)
        yield f"framelet {value}", replace(_part(_light()), refreshed_at=value)


def _passes(message: Message) -> bool:
    """Whether a message is sent and taken."""
    try:
        return _is_taken(serialise(message))
    except LocalProtocolError:
        return False


def _is_taken(data: bytes) -> bool:
    """Whether bytes are taken for a message that has a number which is none."""
    try:
        message = parse_control(data)
    except RemoteProtocolError:
        return False
    if isinstance(message, FrameletPart):
        return not math.isfinite(message.refreshed_at) or _not_finite(message.event)
    return _not_finite(message) if isinstance(message, Event) else True


def _not_finite(event: Event | None) -> bool:
    if event is None:
        return False
    camera = event.camera
    numbers = (*camera.position, *camera.world_from_wall, *camera.eye)
    return not all(map(math.isfinite, (event.scene_time, event.input_time, event.exposure, *numbers)))


def _resealed(data: bytes) -> bytes:
    """A message with the checksum that its bytes have."""
    head, body = data[: HEADER_BYTES - 4], data[HEADER_BYTES:]
    return head + struct.pack("<I", zlib.crc32(body, zlib.crc32(head))) + body


def _light() -> Float32:
    return np.full((EDGE, EDGE, 3), 0.25, np.float32)


def _part(light: Float32) -> FrameletPart:
    """A framelet of some light (h, w, 3), as it is sent."""
    rect = Rect(x=0, y=0, width=light.shape[1], height=light.shape[0])
    whole = Framelet(rect=rect, colour=light, event=EVENT)
    return FrameletPart.of(0, whole, rect)


def pixels(_: int) -> Found:
    """Display bytes beside a pixel whose light is no number that differ from those of the image without it."""
    plain, wrong = _shown(_light()), []
    for value in (*NO_NUMBERS, -1.0, 3.4e38, 1e-45):
        light = _light()
        light[3, 4] = value
        differs = (_shown(light) != plain).any(axis=2)
        differs[3, 4] = False
        wrong += [str(value)] * int(differs.sum())
    return Found(figure=len(wrong), note=", ".join(wrong[:5]))


def _shown(light: Float32) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """(h, w, 3) uint8 of a framelet that came from another rank."""
    came = Framelet.blank(Rect(x=0, y=0, width=EDGE, height=EDGE), frozenset({"colour"}))
    message = parse_control(serialise(_part(light)))
    assert isinstance(message, FrameletPart)
    message.write(came)
    out = np.zeros((EDGE, EDGE, 3), np.uint8)
    kernels.encode(came.colour, 0, 0, srgb_curve(), out, 0, 0, EDGE, EDGE)
    return out


CASES = (
    Case(
        name="not_numbers_in_messages", family="Inputs", unit="messages", bound=0.0,
        reason="a camera or a time that is no number would stay until the next one: who sends it, or whoever gets it, "
        "refuses it",
        scene="NaN and infinities in the numbers of control messages, and over each byte of an event and of a "
        "framelet's head",
        measure=messages, size=1, small=4,
    ),
    Case(
        name="not_numbers_in_framelets", family="Inputs", unit="pixels", bound=0.0,
        reason="a framelet travels exactly, so what is no number in one pixel is to stay there",
        scene="NaN, infinities, -1 and 3.4e38 as one pixel of a framelet from another rank, shown", measure=pixels,
        size=1, small=1,
    ),
)  # fmt: skip
