"""Batches of every shape, and the float64 bounds of docs/guide/packet_format.md, computed another way than the code."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from wall.core.data import SAMPLE, Batch, Float64, Rect, Samples
from wall.core.errors import RemoteProtocolError
from wall.packets.samples import decode

LENGTH_AT, CHECKSUM_AT = 90, 178  # byte offsets in a sample packet's header
HEADER = 182  # bytes
SMALLEST_NORMAL = 2.0**-126
LARGEST_COLOUR = 65408.0
TIME_ROUNDING = 1.0 + 1e-5  # float32 arithmetic around the time code

NORMAL_DEPTHS = st.floats(SMALLEST_NORMAL, float(np.finfo(np.float32).max), width=32)
DEPTHS = st.one_of(
    NORMAL_DEPTHS, st.floats(0.5, 50.0, width=32), st.sampled_from([0.0, -0.0, 1e-45, 1e-39, float("inf")])
)
COLOURS = st.one_of(
    st.floats(0.0, 4.0, width=32),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
    st.sampled_from([0.0, -0.0, 65408.0, 65536.0, 2.0**-16, 2.0**-25, 511.5 / 512, 1e-45]),
)


@st.composite
def batches(draw: st.DrawFn, *, most: int = 20) -> Batch:
    """Any batch that the format can carry; the samples' times begin at 0."""
    width, height = draw(st.integers(1, 4096)), draw(st.integers(1, 4096))
    x, y = draw(st.integers(0, 65535)), draw(st.integers(0, 65535))
    n = draw(st.integers(0, most))
    samples = np.zeros(n, SAMPLE)
    for axis, (corner, edge) in enumerate(((x, width), (y, height))):
        last = float(np.nextafter(np.float32(corner + edge), np.float32(0)))
        samples["xy"][:, axis] = draw(_column(st.floats(float(corner), last, width=32), n))
    for channel in range(3):
        samples["radiance"][:, channel] = draw(_column(COLOURS, n))
    samples["depth"] = draw(_column(DEPTHS, n))
    samples["time"] = draw(_column(st.floats(0.0, 999999.0, width=32), n))
    samples["object_id"] = draw(_column(st.integers(0, 2**32 - 1), n))
    word, long, number = st.integers(0, 65535), st.integers(0, 2**32 - 1), st.integers(0, 2**60 - 1)
    return Batch(
        view=draw(word), panel=draw(word), rect=Rect(x=x, y=y, width=width, height=height), rank=draw(word),
        sequence=draw(st.integers(0, 2**64 - 1)), camera_event=draw(number), scene_event=draw(number),
        base_time=draw(st.floats(allow_nan=False, allow_infinity=False)), samples=samples, frame=draw(number),
        frame_samples=draw(long), skipped=draw(long), blend=draw(st.floats(2.0**-100, 1.0, width=32)),
        depths=draw(st.booleans()), objects=draw(st.booleans()), foreseen=draw(st.booleans()),
    )  # fmt: skip


def _column(values: st.SearchStrategy[Any], n: int) -> st.SearchStrategy[list[Any]]:
    return st.lists(values, min_size=n, max_size=n)


def batch_of(samples: Samples, *, rect: Rect | None = None, **fields: Any) -> Batch:
    """A batch with plain values for everything that a test does not name."""
    plain: dict[str, Any] = {
        "view": 0, "panel": 3, "rank": 2, "sequence": 812, "camera_event": 5, "scene_event": 1, "base_time": 100.25,
    }  # fmt: skip
    return Batch(rect=rect or Rect(x=0, y=0, width=480, height=270), samples=samples, **(plain | fields))


def plain_samples(n: int, *, width: int = 480, height: int = 270, seed: int = 20) -> Samples:
    """(n,) samples such as a tracer makes: colours of a few units, depths of a few octaves, a third of it sky."""
    rng = np.random.default_rng(seed)
    samples = np.zeros(n, SAMPLE)
    samples["xy"] = np.minimum(rng.random((n, 2)) * (width, height), np.nextafter(np.float32((width, height)), 0))
    samples["radiance"] = rng.gamma(1.0, 0.7, (n, 3))
    samples["depth"] = np.where(rng.random(n) < 0.33, np.inf, rng.uniform(2.0, 40.0, n))
    samples["object_id"] = np.where(np.isinf(samples["depth"]), 0, rng.integers(1, 60, n))
    samples["time"] = np.linspace(0.0, 0.0011, n)
    return samples


def relightable_samples(n: int, *, seed: int = 4) -> Samples:
    """(n,) samples of a few objects: plane ones, round ones, each with some shadow."""
    rng = np.random.default_rng(seed)
    samples = plain_samples(n, seed=seed)
    samples["object_id"] %= 6
    round_ones = samples["object_id"] > 2
    samples["normal"] = samples["object_id"][:, None] * (20, -17)
    samples["normal"][round_ones] = rng.integers(-127, 128, (int(round_ones.sum()), 2))
    samples["light_visibility"] = ~rng.choice(np.uint32([0, 1, 5]), n, p=[0.7, 0.2, 0.1])
    return samples


def resealed(packet: bytes | bytearray) -> bytes:
    """The same packet with a body length and a checksum that fit: what an attacker would send."""
    data = bytearray(packet)
    struct.pack_into("<I", data, LENGTH_AT, len(data) - HEADER)
    struct.pack_into("<I", data, CHECKSUM_AT, zlib.crc32(data[HEADER:], zlib.crc32(data[:CHECKSUM_AT])))
    return bytes(data)


def subpixel_bits(edge: int) -> int:
    """14 bits hold the pixel's number, and what it leaves."""
    return 14 - int(np.ceil(np.log2(edge)))


def mantissa_bits(depths: NDArray[np.float32]) -> int:
    """As many mantissa bits as 65,535 codes allow for the packet's octaves of finite depth."""
    finite = np.maximum(np.float64(depths[np.isfinite(depths)]), SMALLEST_NORMAL)
    if len(finite) == 0:
        return 15
    octaves = np.floor(np.log2(finite.max())) - np.floor(np.log2(finite.min())) + 1
    return min(15, int(np.floor(np.log2(65534 / octaves))))


def check_bounds(sent: Batch, came: Batch) -> None:
    """Every sample of `came` lies as near to that of `sent` as the document promises."""
    a, b, rect = sent.samples, came.samples, sent.rect
    assert len(a) == len(b)
    for axis, edge in enumerate((rect.width, rect.height)):
        error = np.float64(a["xy"][:, axis]) - b["xy"][:, axis]
        assert ((error >= 0) & (error < 2.0 ** -subpixel_bits(edge))).all()
    assert (np.floor(a["xy"]) == np.floor(b["xy"])).all()
    colour = np.clip(np.float64(a["radiance"]), 0.0, LARGEST_COLOUR)
    bound = np.maximum(colour.max(axis=1, initial=0.0) / 511, 2.0**-25)
    assert (np.abs(b["radiance"] - colour) <= bound[:, None]).all()
    if sent.depths:
        check_depths(a["depth"], b["depth"])
    else:
        assert np.isposinf(b["depth"]).all()
    assert (b["object_id"] == (a["object_id"] if sent.objects else 0)).all()
    span = float(a["time"].max(initial=0.0))
    assert (np.abs(np.float64(a["time"]) - b["time"]) <= max(span / 6 * TIME_ROUNDING, 1e-30)).all()


def check_depths(sent: NDArray[np.float32], came: NDArray[np.float32]) -> None:
    assert (np.isinf(sent) == np.isinf(came)).all()
    finite = np.isfinite(sent)
    a, b = np.float64(sent[finite]), np.float64(came[finite])
    assert (np.abs(a - b) <= np.maximum(a * 2.0 ** -(mantissa_bits(sent) + 1), SMALLEST_NORMAL)).all()


def check_sane(batch: Batch) -> None:
    """What any decoded batch must hold, whoever sent it: nothing that could harm an image or an array."""
    samples, rect = batch.samples, batch.rect
    assert len(samples) <= 65536
    assert 0 < rect.width <= 4096
    assert 0 < rect.height <= 4096
    inside: Float64 = np.floor(np.float64(samples["xy"])) - (rect.x, rect.y)
    assert ((inside >= 0) & (inside < (rect.width, rect.height))).all()
    assert np.isfinite(samples["radiance"]).all()
    assert (samples["radiance"] >= 0).all()
    assert (samples["depth"] >= 0).all()
    assert (samples["normal"] >= -127).all()
    assert (np.isfinite(samples["time"]) & (samples["time"] >= 0)).all()
    assert np.isfinite(batch.base_time)
    assert 0.0 < batch.blend <= 1.0


def check_flipped_bits(packet: bytes) -> None:
    """Every bit behind the header flipped under a valid checksum: refused, or still a sane batch."""
    accepted = 0
    for bit in range(8 * HEADER, 8 * len(packet)):
        changed = bytearray(packet)
        changed[bit // 8] ^= 1 << bit % 8
        try:
            check_sane(decode(resealed(changed)))
            accepted += 1
        except RemoteProtocolError:
            continue
    assert 10 < accepted < 8 * (len(packet) - HEADER)  # the test looks at both outcomes
