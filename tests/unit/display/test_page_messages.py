"""What a page may send, who may connect, and the bytes that a page is sent."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from wall.core.data import StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.display.steering import MAX_MESSAGE_BYTES, OVERLAYS, host_is_ours, origin_is_ours, parse_message
from wall.display.stream import (
    HEADER,
    STATISTICS_HEADER,
    encode_jpeg,
    layout_message,
    panel_message,
    statistics_message,
    status_message,
)
from wall.geometry.steering import Command, parse

GOOD = [
    {"kind": "orbit", "x": 0.25, "y": -1},
    {"kind": "pan", "x": 0, "y": 10.0},
    {"kind": "zoom", "x": 1.1},
    {"kind": "pause"},
    {"kind": "reset"},
    {"kind": "sampler", "value": "hilbert"},
    {"kind": "compare", "value": "framed"},
    {"kind": "overlay", "value": "age"},
    {"kind": "display", "value": "samples"},
    {"kind": "display", "value": "nothing"},
    {"kind": "pause", "paused": True},
    {"kind": "orbit", "id": 2**53, "x": [None]},
    {"kind": "load", "id": "a b", "text": "x" * MAX_MESSAGE_BYTES},
    {"kind": "shown", "number": 7},
]
BAD = [
    "",
    "7",
    "[]",
    "null",
    '"orbit"',
    "{",
    "{}",
    '{"kind": "explode"}',
    '{"kind": "display", "value": "photons"}',
    '{"kind": "display"}',
    '{"kind": ["orbit"]}',
    '{"kind": null}',
    '{"kind": "orbit", "x": 1}',
    '{"kind": "orbit", "x": 1, "y": 2, "z": 3}',
    '{"kind": "orbit", "x": "1", "y": 2}',
    '{"kind": "orbit", "x": true, "y": 2}',
    '{"kind": "orbit", "x": NaN, "y": 0}',
    '{"kind": "pan", "x": Infinity, "y": 0}',
    '{"kind": "pan", "x": 1e999, "y": 0}',
    '{"kind": "pan", "x": 10.5, "y": 0}',
    '{"kind": "orbit", "x": ' + "9" * 400 + ', "y": 0}',
    '{"kind": "zoom", "x": 0}',
    '{"kind": "zoom", "x": -1}',
    '{"kind": "zoom", "x": 65}',
    '{"kind": "pause", "value": true}',
    '{"kind": "sampler", "value": ""}',
    '{"kind": "sampler", "value": 3}',
    '{"kind": "sampler", "value": "' + "x" * 65 + '"}',
    '{"kind": "compare"}',
    '{"kind": "compare", "value": 1}',
    '{"kind": "compare", "value": "' + "x" * 65 + '"}',
    '{"kind": "overlay", "value": "depth"}',
    '{"kind": "overlay", "value": ["age"]}',
    '{"kind": "overlay", "value": null}',
    '{"kind": "statistics", "value": "on"}',
    '{"kind": "shown", "number": 1.5}',
    '{"kind": "shown", "number": -1}',
    '{"kind": "pause"' + " " * MAX_MESSAGE_BYTES + "}",
    "[" * MAX_MESSAGE_BYTES,
]


@pytest.mark.parametrize("message", GOOD, ids=lambda m: m["kind"])
def test_every_kind_comes_through_unchanged(message):
    assert parse_message(json.dumps(message)) == message


@pytest.mark.parametrize("factor", [1 / 64, 1 / 32, 32, 64])
def test_what_a_page_may_zoom_the_camera_takes(factor):
    """Pages and windows send up to 64 times; a second parser used to refuse what was beyond 10."""
    message = parse_message(json.dumps({"kind": "zoom", "x": factor}))
    assert parse(message) == Command(kind="zoom", x=factor)


@pytest.mark.parametrize("text", BAD)
def test_garbage_is_refused(text):
    with pytest.raises(RemoteProtocolError, match="page message"):
        parse_message(text)


@given(
    st.text(max_size=80)
    | st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.sampled_from(["kind", "x", "y", "orbit", "zoom"]),
        lambda inner: (
            st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["kind", "x", "y", "value"]), inner)
        ),
        max_leaves=6,
    ).map(json.dumps)
)
def test_any_text_gives_a_checked_command_or_remote_protocol_error(text):
    try:
        message = parse_message(text)
    except RemoteProtocolError:
        return
    assert message["kind"] in {m["kind"] for m in GOOD}
    assert all(np.isfinite(message[name]) for name in ("x", "y") if name in message)


@pytest.mark.parametrize(
    ("header", "bound", "ours"),
    [
        ("127.0.0.1:8080", "127.0.0.1", True),
        ("localhost:9999", "127.0.0.1", True),  # a forwarded port
        ("[::1]:8080", "127.0.0.1", True),
        ("LOCALHOST", "localhost", True),
        ("evil.example:8080", "127.0.0.1", False),  # a name that was rebound to loopback
        ("localhost.evil.example", "127.0.0.1", False),
        ("127.0.0.1.evil.example", "127.0.0.1", False),
        ("evil@127.0.0.1:x", "127.0.0.1", True),  # no browser sends this; the name is still ours
        ("10.0.0.7:8080", "127.0.0.1", False),
        ("10.0.0.7:8080", "0.0.0.0", True),
        ("node7:8080", "0.0.0.0", True),
        ("evil.example", "0.0.0.0", False),
        ("viewer.example", "viewer.example", True),
        ("", "127.0.0.1", False),
        ("[", "127.0.0.1", False),
    ],
)
def test_host_header_must_name_this_machine(header, bound, ours):
    assert host_is_ours(header, bound, frozenset({"node7"})) is ours


@pytest.mark.parametrize(
    ("origin", "ours"),
    [
        (None, True),
        ("http://127.0.0.1:8080", True),
        ("https://127.0.0.1:8080", True),
        ("http://127.0.0.1:8081", False),
        ("http://evil.example", False),
        ("null", False),
        ("file://127.0.0.1:8080", False),
        ("http://[", False),
    ],
)
def test_websocket_origin_must_be_the_served_page(origin, ours):
    assert origin_is_ours(origin, "127.0.0.1:8080") is ours


def test_panel_message_is_a_20_byte_header_and_a_jpeg(image):
    panel = image(2**32 + 5).panels[1]
    every = np.ones((1, 1), bool)
    message = panel_message(1, panel, every, encoded=encode_jpeg(panel.rgb), number=9)
    assert HEADER.size == 20
    assert HEADER.unpack(message[:20]) == (b"WP", 4, 0, 1, 16, 8, 0, 5, 9)
    second = panel_message(1, panel, every, encoded=b"", number=9, compared=True)
    assert HEADER.unpack(second) == (b"WP", 4, 1, 1, 16, 8, 0, 5, 9)
    assert np.array(Image.open(io.BytesIO(message[20:]))).shape == (8, 16, 3)


def test_jpeg_stays_close_to_a_smooth_image(two_panels):
    """Quality 88 quantises the low frequencies by at most 3 steps, halved by rounding; 3 channels mix them."""
    y, x = np.mgrid[:64, :96]
    rgb = np.stack([2 * x, 3 * y, 255 - x - y], -1).astype(np.uint8)
    jpeg = encode_jpeg(rgb)
    error = np.abs(np.array(Image.open(io.BytesIO(jpeg))).astype(int) - rgb)
    assert error.max() <= 8
    assert error.mean() <= 1.5


@pytest.mark.parametrize(("overlay", "rects", "body"), [("age", 0, 1), ("density", 0, 7), ("tiles", 2, None)])
def test_statistics_message_is_a_16_byte_header_and_what_its_overlay_draws(overlay, rects, body):
    codes = np.arange(6, dtype=np.uint8).reshape(2, 3) + 1
    statistics_image = StatisticsImage(
        panel=3, compared=True, age=codes, density=codes + 6, rects=np.arange(8, dtype=np.uint16).reshape(2, 4),
        error_reduction=np.array([40, 41], np.uint8),
    )  # fmt: skip
    message = statistics_message(statistics_image, overlay)
    assert STATISTICS_HEADER.size == 16  # so that the page reads 16-bit numbers behind it
    assert STATISTICS_HEADER.unpack(message[:16]) == (b"WS", 4, 1, 3, OVERLAYS.index(overlay), 2, 3, rects)
    if body is not None:
        assert message[16:] == bytes(range(body, body + 6))
    else:
        assert np.frombuffer(message[16:32], "<u2").tolist() == list(range(8))
        assert message[32:] == bytes([40, 41])


def test_layout_gives_every_panels_true_place(two_panels):
    layout = json.loads(layout_message(two_panels, ["main"]))
    assert (layout["width"], layout["height"]) == (two_panels.width, two_panels.height)
    first, second = layout["panels"]
    assert (first["id"], first["width"], first["height"]) == ("r0c0", 16, 8)
    assert second["x"] - first["x"] == 18  # 16 pixels and a bezel of 1 + 1 cm at 1 cm a pixel


def test_status_is_strict_json_whatever_the_numbers(status):
    text = status_message(status, viewers=2)
    message = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert message["ranks"][1]["oldest_sample_s"] is None
    assert message["latency_ms"] == [20.0, 30.0, 40.0]
    assert message["viewers"] == 2
