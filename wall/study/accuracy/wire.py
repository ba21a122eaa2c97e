"""What packets do to samples: the worst value of every field, the range of light, numbers that are none.

The worst values of a quantised field lie at the borders between codes, so these are searched, not drawn by chance.
"""

from __future__ import annotations

import math
from collections import Counter
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wall.core.data import SAMPLE, Batch, Camera, Float32, Float64, Rect, Samples
from wall.core.errors import LocalProtocolError
from wall.packets.colour_curve import linear_colours
from wall.packets.kernels import compact_body, plain_body
from wall.packets.kernels.colour_codes import dither, dither_bits
from wall.packets.samples import MAX_SAMPLES, TOO_BRIGHT, decode, encode
from wall.study.accuracy.case import Case, Found

RECT = Rect(x=0, y=0, width=256, height=256)
COMPACT_CODES = 0.51  # that a compact colour is off by at most, see docs/guide/packet_format.md
BROKEN = (math.nan, math.inf, -math.inf, -1.0, 1e-45, -0.0, 3.4e38)  # -1 and 3.4e38: numbers, but not every field's


def through(
    samples: Samples, *, adaptive: bool, rect: Rect = RECT, noisy: bool = False, relightable: bool = False
) -> Samples:
    """(n,) SAMPLE as they arrive, in the order in which they went; object ids are overwritten."""
    found = []
    for begin in range(0, len(samples), MAX_SAMPLES):
        part = samples[begin : begin + MAX_SAMPLES].copy()
        part["object_id"] = np.arange(len(part))  # compact bodies come back by object
        batch = batch_of(part, rect=rect, adaptive=adaptive, noisy=noisy, relightable=relightable)
        found.append(decode(encode(batch)).samples)
    return np.concatenate(found)


def batch_of(samples: Samples, *, rect: Rect = RECT, **more: Any) -> Batch:
    """A batch of samples, with any of its fields."""
    numbers: dict[str, Any] = {"rank": 1, "sequence": 1, "camera_event": 1, "scene_event": 0, "base_time": 0.0}
    return Batch(**{"view": 0, "panel": 0, "rect": rect, "samples": samples, **numbers, **more})


def at_borders(borders: ArrayLike) -> Float32:
    """(n,) float32: each border, and the numbers just below and above it."""
    middle = np.asarray(borders, np.float64).astype(np.float32)
    return np.unique(
        np.concatenate([np.nextafter(middle, np.float32(0)), middle, np.nextafter(middle, np.float32(9e37))])
    )


def samples_of(count: int, **fields: ArrayLike) -> Samples:
    """(count,) SAMPLE with these fields, at the middle of the first pixel unless `xy` is given."""
    samples = np.zeros(count, SAMPLE)
    samples["xy"] = 0.5
    for name, values in fields.items():
        samples[name] = values
    return samples


def plain_colour(mantissas: int) -> Found:
    """Largest error of a channel over the colour's largest one, at the borders of all exponents."""
    steps = np.unique(np.linspace(256, 511, mantissas).astype(int)) + 0.5
    values = at_borders([step * 2.0**e for e in range(-24, 8) for step in steps])
    values = values[values <= plain_body.LARGEST_COLOUR]
    worst, where = 0.0, 0.0
    for low in (0.0, 0.25, 0.499, 1.0):
        colours = np.stack([values, values * np.float32(low), values], axis=1)
        came = through(samples_of(len(values), radiance=colours), adaptive=False)["radiance"]
        error = np.abs(came.astype(np.float64) - colours).max(axis=1) / values
        worst, where = max((worst, where), (float(error.max()), float(values[error.argmax()])))
    return Found(figure=worst, note=f"worst at {where:.8g}, of {len(values):,} values")


def compact_colour(offsets: int) -> Found:
    """Largest error in codes, at the borders of all codes, at sub-pixels of so many dither offsets."""
    curve, worst, tried = linear_colours(), 0.0, 0
    for k in range(offsets):
        x, y = (k * 37) % 2048, (k * 101) % 2048
        shift = float(dither(dither_bits(np.int64(x), np.int64(y))))
        borders = np.interp(np.arange(1, 1534) - shift, np.arange(len(curve)), curve)
        values = at_borders(borders[borders > 0.0])
        colours = np.zeros((len(values), 3), np.float32)
        colours[:, 0] = values
        samples = samples_of(len(values), radiance=colours)
        samples["xy"] = ((x + 0.5) / 8, (y + 0.5) / 8)
        came = through(samples, adaptive=True)["radiance"][:, 0]
        codes = [np.interp(v.astype(np.float64), curve, np.arange(len(curve))) for v in (came, values)]
        worst, tried = max(worst, float(np.abs(codes[0] - codes[1]).max())), tried + len(values)
    return Found(figure=worst, note=f"of {tried:,} values")


def depth_error(adaptive: bool, borders: int) -> Found:
    """Largest relative error of a depth over half a step's, for packets of 1 to 254 octaves."""
    worst, where = 0.0, ""
    for octaves in (1, 2, 3, 8, 15, 64, 128, 254):
        bits = compact_body.DEPTH_BITS if adaptive else min(15, int(math.log2(65534 // octaves)))
        low = -126 if octaves > 100 else -octaves // 2
        mantissas = 1.0 + (np.unique(np.linspace(0, 2**bits - 1, borders).astype(int)) + 0.5) * 2.0**-bits
        values = at_borders(np.outer(2.0 ** np.arange(low, low + octaves, max(1, octaves // 8)), mantissas).ravel())
        values = np.concatenate([np.array([2.0**low, 2.0 ** (low + octaves) * (1 - 2.0**-24)], np.float32), values])
        values = np.resize(values[np.isfinite(values)], min(len(values), MAX_SAMPLES))
        values[:2] = 2.0**low, np.nextafter(np.float32(2.0 ** min(127, low + octaves - 1)), np.float32(9e37))
        came = through(samples_of(len(values), depth=values), adaptive=adaptive)["depth"].astype(np.float64)
        error = float((np.abs(came - values) / values).max() * 2.0 ** (bits + 1))
        worst, where = max((worst, where), (error, f"{octaves} octaves"))
    return Found(figure=worst, note=f"worst with {where}")


def time_error(adaptive: bool, spans: int) -> Found:
    """Largest error of a time over half a step, at the borders of all time codes, for spans of 1e-6 to 1e6 s."""
    steps, worst = compact_body.TIME_STEPS if adaptive else plain_body.TIME_STEPS, 0.0
    for span in np.geomspace(1e-6, 999_999.0, spans).astype(np.float32):
        values = np.append(at_borders((np.arange(steps) + 0.5) / steps * float(span)), span)
        came = through(samples_of(len(values), time=values), adaptive=adaptive)["time"].astype(np.float64)
        worst = max(worst, float(np.abs(came - values).max() / float(span) * 2 * steps))
    return Found(figure=worst)


def position_error(adaptive: bool, edge: int) -> Found:
    """Largest error of a position in steps of a sub-pixel, at the borders of all of them along an edge."""
    bits = compact_body.SUBPIXEL_BITS if adaptive else 14 - math.ceil(math.log2(edge))
    values = at_borders(np.arange(1, edge * 2**bits) / 2**bits)
    samples = samples_of(len(values))
    samples["xy"][:, 0] = values
    came = through(samples, adaptive=adaptive, rect=Rect(x=0, y=0, width=edge, height=1))["xy"][:, 0]
    moved = int((np.floor(came) != np.floor(values)).sum())
    error = float(np.abs(came.astype(np.float64) - values).max() * 2**bits)
    return Found(figure=math.inf if moved else error, note=f"{moved} of {len(values):,} left their pixel")


def change_error(count: int) -> Found:
    """Largest error of `change` over half a step, at the borders of its codes and at `count` values between."""
    steps = compact_body.CHANGE_STEPS
    values = np.concatenate([at_borders((np.arange(steps) + 0.5) / steps), np.linspace(0, 1, count, dtype=np.float32)])
    came = through(samples_of(len(values), change=values), adaptive=True)["change"].astype(np.float64)
    return Found(figure=float(np.abs(came - values).max() * 2 * steps))


def normal_error(step: int) -> Found:
    """Largest angle, degrees, between octahedral normals of 8 bits and what arrives; every `step`-th each way."""
    codes = np.arange(-127, 128, step, dtype=np.int8)
    pairs = np.stack(np.meshgrid(codes, codes), axis=-1).reshape(-1, 2)
    samples = samples_of(len(pairs), radiance=1.0)
    samples["normal"] = pairs
    came = through(samples, adaptive=True, noisy=True)["normal"]
    a, b = _directions(pairs), _directions(came)
    angles = np.degrees(2.0 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=1) / 2.0, 0.0, 1.0)))
    return Found(figure=float(angles.max()), note=f"of {len(pairs):,} normals")


def _directions(codes: NDArray[np.int8]) -> Float64:
    """(n, 3) unit vectors of octahedral codes (n, 2), in float64 (Cigolle et al. 2014)."""
    x, y = codes.astype(np.float64).T / 127.0
    z = 1.0 - np.abs(x) - np.abs(y)
    below = np.maximum(-z, 0.0)
    found = np.stack([x - np.copysign(below, x), y - np.copysign(below, y), z], axis=1)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True), np.float64)


def light_range(adaptive: bool, count: int) -> Found:
    """Largest relative error of grey light from 1e-6 to 1e6, beyond half a code where codes are not of equal ratio.

    That is the last code of the plain layout, and those of the compact one below 1, which are those of sRGB.

    Light above what packets carry is to arrive as the most that they carry, and to be counted by who sends it.
    """
    values = np.geomspace(1e-6, 1e6, count).astype(np.float32)
    came = through(samples_of(len(values), radiance=values[:, None]), adaptive=adaptive)["radiance"][:, 0]
    carried = np.minimum(values, np.float32(plain_body.LARGEST_COLOUR)).astype(np.float64)
    even = np.where(carried < 1.0, COMPACT_CODES * _step_at(carried), 0.0) if adaptive else 2.0**-25
    beyond = np.maximum(np.abs(came - carried) - even, 0.0) / carried
    counters, above = Counter[str](), int((values > plain_body.LARGEST_COLOUR).sum())
    encode(batch_of(samples_of(count, radiance=values[:, None]), adaptive=adaptive), counters=counters)
    counted = counters[TOO_BRIGHT]
    note = f"1e6 arrives as {came[-1]:,.0f}, 1e-6 as {came[0]:.3g}; {counted} of {above} above are counted"
    return Found(figure=float(beyond.max()) if counted == above else math.inf, note=note)


def _step_at(light: Float64) -> Float64:
    """(n,) the code of the compact curve above that of light (n,), its width in light; they grow with light."""
    curve = linear_colours()
    code = np.interp(light, curve, np.arange(len(curve))).astype(int)
    return np.asarray(np.diff(curve)[np.minimum(code + 1, len(curve) - 2)], np.float64)


def broken_numbers(_: int) -> Found:
    """How many numbers that are none leave as a packet, and arrive, as something that is not finite."""
    passed = []
    for adaptive in (False, True):
        for name in ("xy", "radiance", "depth", "time", "change", "sqrt_irradiance"):
            for value in BROKEN:
                samples = samples_of(3, depth=1.0, radiance=0.5)
                samples[name][1] = value
                if not _harmless(batch_of(samples, adaptive=adaptive)):
                    passed.append(f"{name} {value}")
        for name in ("base_time", "blend", "scene_time"):
            for value in BROKEN:
                changed = dict[str, Any]({name: value})
                if not _harmless(batch_of(samples_of(3, depth=1.0), adaptive=adaptive, **changed)):
                    passed.append(f"{name} {value}")
        for at in range(12):
            for value in BROKEN[:3]:
                position, turn = [0.0, 0.0, 0.0], np.eye(3).ravel().tolist()
                (position if at < 3 else turn)[at if at < 3 else at - 3] = value
                camera = Camera(position=(position[0], position[1], position[2]), world_from_wall=tuple(turn))
                if not _harmless(batch_of(samples_of(3, depth=1.0), adaptive=adaptive, camera=camera)):
                    passed.append(f"camera {at} {value}")
    return Found(figure=len(passed), note=", ".join(passed[:6]))


def _harmless(batch: Batch) -> bool:
    """Whether a batch is refused, or arrives finite (but for depth, which may be infinite)."""
    try:
        came = decode(encode(batch))
    except LocalProtocolError:
        return True
    samples = came.samples
    finite = all(np.isfinite(samples[name]).all() for name in ("xy", "radiance", "time", "change"))
    numbers = (came.base_time, came.blend, came.scene_time, *came.camera.position, *came.camera.world_from_wall)
    return finite and not bool(np.isnan(samples["depth"]).any()) and all(map(math.isfinite, numbers))


def numbers_at_their_end(_: int) -> Found:
    """How many of a packet's numbers do not arrive when they are the largest that their fields hold, or the next."""
    wrong = []
    for name, bits in (("sequence", 64), ("camera_event", 60), ("scene_event", 60), ("frame", 60), ("rank", 16)):
        for value in (2 ** (bits - 1), 2**bits - 1):
            if getattr(decode(encode(batch_of(samples_of(1), **{name: value}))), name) != value:
                wrong.append(f"{name} {value}")
        try:
            encode(batch_of(samples_of(1), **{name: 2**bits}))
            wrong.append(f"{name} 2^{bits} is sent")
        except LocalProtocolError:
            pass
    return Found(figure=len(wrong), note=", ".join(wrong))


_HALF = "half a step is the least that rounding to steps can do"
_ROUNDED = _HALF + "; float32 adds 4e-5 of it"
_WIRE = "Packets"
CASES = (
    Case(
        name="plain_colour", family=_WIRE, unit="of the largest channel", bound=1 / 511,
        reason="nine bits with one exponent: half a step of 1/256 to 1/511.5 of the largest channel",
        scene="Colours at the borders of shared-exponent codes", measure=plain_colour, size=256, small=16,
    ),
    Case(
        name="compact_colour", family=_WIRE, unit="codes", bound=0.501,
        reason=_HALF + "; float32 places a colour on the curve to 1,535 x 2^-24 x 4 = 4e-4 codes",
        scene="Colours at the borders of curve codes, at many dither offsets", measure=compact_colour,
        size=256, small=4, long=4096,
    ),
    *(
        Case(
            name=f"{kind}_depth", family=_WIRE, unit="half steps", bound=1.0, reason=_HALF,
            scene="Depths at the borders of codes, in packets of 1 to 254 octaves",
            measure=partial(depth_error, kind == "compact"), size=2048, small=64,
        )
        for kind in ("plain", "compact")
    ),
    *(
        Case(
            name=f"{kind}_time", family=_WIRE, unit="half steps", bound=1.00004, reason=_ROUNDED,
            scene="Times at the borders of codes, in packets that span 1e-6 to 1e6 s",
            measure=partial(time_error, kind == "compact"), size=512, small=8,
        )
        for kind in ("plain", "compact")
    ),
    Case(
        name="plain_position", family=_WIRE, unit="steps", bound=1.0,
        reason="positions are rounded down to a sub-pixel, so that none leaves its pixel",
        scene="Positions at the borders of sub-pixels, 4,096 pixels wide", measure=partial(position_error, False),
        size=4096, small=64,
    ),
    Case(
        name="compact_position", family=_WIRE, unit="steps", bound=0.5 + 2.0**-9,
        reason="positions come back in the middle of their sub-pixel; a float32 at 4,096 adds 2^-12 pixels",
        scene="The same of compact packets", measure=partial(position_error, True), size=4096, small=64,
    ),
    Case(
        name="change", family=_WIRE, unit="half steps", bound=1.00004, reason=_ROUNDED,
        scene="How much a sample contradicts the image, at the borders of its codes", measure=change_error, size=4096,
        small=64,
    ),
    Case(
        name="normal", family=_WIRE, unit="degrees", bound=math.degrees(math.sqrt(18.0) * 2.0 / 127.0),
        reason="codes of 31 steps to either side are off by 2 of 127, and an octahedron turns a step of its codes "
        "into at most sqrt(18) times as many radians",
        scene="All octahedral normals of 8 bits", measure=normal_error, size=1, small=16,
    ),
    *(
        Case(
            name=f"{kind}_light_range", family=_WIRE, unit="of the light", bound=bound, reason=reason,
            scene="Grey light from 1e-6 to 1e6", measure=partial(light_range, kind == "compact"), size=4096, small=256,
        )
        for kind, bound, reason in (
            ("plain", 1 / 511, "half a step of nine bits up to 65,408; light above is cut off there, and counted"),
            ("compact", 2 ** (COMPACT_CODES / 80) - 1, "half a code of 80 an octave up to 65,408; light "
             "above is cut off there, and counted"),
        )
    ),
    Case(
        name="not_numbers_in_samples", family=_WIRE, unit="fields", bound=0.0,
        reason="a sender refuses what is not finite where it must be: one such value would spread over the image",
        scene="NaN, infinities, denormals and negative zero in each number of a batch",
        measure=broken_numbers, size=1, small=1,
    ),
    Case(
        name="largest_numbers", family=_WIRE, unit="fields", bound=0.0,
        reason="numbers are exact or refused, never wrapped",
        scene="Sequence, event, frame and rank numbers at the end of their fields and one beyond",
        measure=numbers_at_their_end, size=1, small=1,
    ),
)  # fmt: skip
