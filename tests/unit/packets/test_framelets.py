"""Parts of framelets on the wire: every set of channels comes back exactly, what does not fit is refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from framelets import EVERY, assert_equal, random_framelet, rect
from hypothesis import given, settings
from hypothesis import strategies as st

from wall.core.data import CHANNELS, Camera, Event, Framelet
from wall.core.errors import RemoteProtocolError
from wall.packets.control import HEADER_BYTES, parse_control, serialise
from wall.packets.framelets import HEAD, MAX_RAW, FrameletPart, bands, bytes_a_pixel

SETS = [frozenset({"colour", *more}) for n in range(6) for more in combinations(CHANNELS[1:], n)]
EVENT = Event(
    view=2, camera_event=3, scene_event=4, scene_time=5.5, input_time=9.0,
    camera=Camera(position=(1.0, 2.0, 3.0), world_from_wall=tuple(float(k) for k in range(9))),
)  # fmt: skip


def sent(framelet: Framelet, *, compared: bool = False, plain: bool = False) -> FrameletPart:
    part = parse_control(serialise(FrameletPart.of(7, framelet, framelet.rect, compared=compared, plain=plain)))
    assert isinstance(part, FrameletPart)
    return part


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("encoded", [False, True])
@pytest.mark.parametrize("channels", SETS, ids=lambda channels: "+".join(c for c in CHANNELS if c in channels))
def test_every_set_of_channels_comes_back_exactly(channels: frozenset[str], encoded: bool, plain: bool) -> None:
    framelet = random_framelet(np.random.default_rng(1), rect(-3, 5, 7, 4), channels=channels, encoded=encoded)
    if not encoded:
        framelet.colour[0, 0] = (np.nan, np.inf, -0.0)
    framelet.event, framelet.refreshed_at = EVENT, 12.5
    part = sent(framelet, compared=encoded, plain=plain)
    out = Framelet.blank(framelet.rect, channels, encoded=encoded)
    part.write(out)
    assert_equal(out, framelet)
    assert (part.step, part.compared, part.encoded, part.refreshed_at) == (7, encoded, encoded, 12.5)
    assert part.plain == plain
    assert part.event is not None
    told = (part.event.number, part.event.camera, part.event.scene_time)
    assert told == ((3, 4), EVENT.camera, 5.5), "numbers, camera and scene time travel"


@given(x=st.integers(0, 8), y=st.integers(0, 6), width=st.integers(1, 8), height=st.integers(1, 6), plain=st.booleans())
@settings(max_examples=40, deadline=None)
def test_a_part_writes_its_own_pixels_and_no_other(x: int, y: int, width: int, height: int, plain: bool) -> None:
    whole = random_framelet(np.random.default_rng(2), rect(10, 20, 16, 12))
    here = rect(10 + x, 20 + y, width, height)
    out = Framelet.blank(rect(5, 15, 30, 30), EVERY)
    before = out.colour.copy()
    FrameletPart.of(0, whole, here, plain=plain).write(out)
    for name in CHANNELS:
        inside, source = here.inside(out.rect), here.inside(whole.rect)
        np.testing.assert_array_equal(out.channel(name)[inside], whole.channel(name)[source])
    out.colour[here.inside(out.rect)] = before[here.inside(out.rect)]
    np.testing.assert_array_equal(out.colour, before)


@pytest.mark.parametrize(
    "out",
    [
        Framelet.blank(rect(0, 0, 8, 5), frozenset({"colour", "depth"})),
        Framelet.blank(rect(0, 0, 8, 6), frozenset({"colour"})),
        Framelet.blank(rect(0, 0, 8, 6), frozenset({"colour", "depth", "time"})),
        Framelet.blank(rect(0, 0, 8, 6), frozenset({"colour", "depth"}), encoded=True),
        Framelet.blank(rect(1, 0, 8, 6), frozenset({"colour", "depth"})),
    ],
    ids=["lower", "fewer channels", "more channels", "bytes", "beside"],
)
def test_a_part_that_does_not_fit_is_refused_before_anything_is_written(out: Framelet) -> None:
    part = sent(random_framelet(np.random.default_rng(3), rect(0, 0, 8, 6), channels=frozenset({"colour", "depth"})))
    with pytest.raises(RemoteProtocolError, match="wanted: inside"):
        part.write(out)
    assert not out.colour.any()


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize(
    "change", [{"data": b""}, {"data": b"\xff" * 64}, {"rect": rect(0, 0, 8, 5)}, {"rect": rect(0, 0, 9, 6)}], ids=str
)
def test_data_that_is_not_the_rectangle_s_is_refused(change: dict[str, object], plain: bool) -> None:
    part = FrameletPart.of(1, Framelet.blank(rect(0, 0, 8, 6), EVERY), rect(0, 0, 8, 6), plain=plain)
    wrong = replace(part, **change)  # type: ignore[arg-type]
    with pytest.raises(RemoteProtocolError, match="framelet of step 1"):
        wrong.write(Framelet.blank(rect(0, 0, 9, 6), EVERY))


def test_the_checksum_of_plain_pixels_covers_their_head() -> None:
    """What carries them is memory; a head that differs in any bit is refused, pixels count by their number."""
    data = serialise(FrameletPart.of(1, Framelet.blank(rect(0, 0, 8, 6), EVERY), rect(0, 0, 8, 6), plain=True))
    for k in range(HEADER_BYTES + HEAD.size):
        with pytest.raises(RemoteProtocolError):
            parse_control(data[:k] + bytes([data[k] ^ 1]) + data[k + 1 :])
    for wrong in (data[:-1], data + b"0"):
        with pytest.raises(RemoteProtocolError):
            parse_control(wrong)


def test_large_rectangles_are_cut_into_bands_that_fit_a_message() -> None:
    whole = rect(-5, 7, 7680, 4320)
    for channels in (frozenset({"colour"}), EVERY):
        found = bands(whole, channels, encoded=False)
        assert all(part.area * bytes_a_pixel(channels, encoded=False) <= MAX_RAW for part in found)
        assert [part.y for part in found[1:]] == [part.bottom for part in found[:-1]]
        assert (found[0].y, found[-1].bottom) == (whole.y, whole.bottom)
        assert {(part.x, part.width) for part in found} == {(whole.x, whole.width)}
