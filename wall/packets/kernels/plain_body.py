"""Pack samples into 8 to 12 bytes and back, one pass each; only integer operations on the float's own bits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.jit import bit_kernel, inline_kernel, kernel

POSITION_BITS = 14
POSITION_MASK = 0x3FFF
INFINITE_DEPTH = 0xFFFF  # code of a depth
INFINITY_BITS, LARGEST_FINITE_BITS = 0x7F800000, 0x7F7FFFFF  # of float32
TIME_STEPS = 3  # 2 bits
MAX_SPAN_S = 1e6  # a packet's times span less
SHORTEST_SPAN_S = 1e-30  # shorter ones count as 0: 63 / span would overflow
LARGEST_COLOUR = 65408.0  # 511/512 * 2^16, the largest value of the shared-exponent format


class Scales(NamedTuple):
    """What the codes of one packet mean."""

    x_bits: int  # sub-pixel bits of positions
    y_bits: int
    depth_base: int  # float32 exponent of depth code 0
    depth_bits: int  # mantissa bits of a depth code
    time_span: np.float32  # seconds of time code TIME_STEPS


class Planes(NamedTuple):
    """Views of one body of n samples."""

    colours: NDArray[np.uint32]  # (n,)
    xs: NDArray[np.uint16]  # (n,) position, time code above it
    ys: NDArray[np.uint16]  # (n,) position
    depths: NDArray[np.uint16]  # (n,), or none: depths are not sent
    objects: NDArray[np.uint16]  # (n,) object ids, or their indices in the packet's table; or none: they are not sent


@inline_kernel
def shared_exponent(r, g, b):
    """RGB9E5: three 9-bit mantissas with one 5-bit exponent, as in EXT_texture_shared_exponent, by bit operations."""
    top = np.float32(LARGEST_COLOUR)
    r, g, b = min(max(r, np.float32(0.0)), top), min(max(g, np.float32(0.0)), top), min(max(b, np.float32(0.0)), top)
    largest = max(r, max(g, b))
    exponent = max(np.int32(np.float32(largest).view(np.int32) >> 23) - 111, np.int32(0))  # floor(log2) + 16
    scale = np.int32((151 - exponent) << 23).view(np.float32)  # 2^(24 - exponent)
    half = np.float32(0.5)
    if np.int32(largest * scale + half) == 512:
        exponent += np.int32(1)
        scale *= half
    red, green, blue = np.uint32(r * scale + half), np.uint32(g * scale + half), np.uint32(b * scale + half)
    return np.uint32(red | (green << np.uint32(9)) | (blue << np.uint32(18)) | (np.uint32(exponent) << np.uint32(27)))


@kernel
def depth_range(samples):
    """The smallest and largest float32 exponent of the finite depths, the latest time, what cannot be sent as it is.

    samples : (n,) SAMPLE. Returns (low, high, latest, bad, bright): low > high if no depth is finite; latest in seconds
    after the base time, 0 for n = 0; bad counts samples whose radiance is not finite, or whose depth or time is
    negative or NaN, or whose time is MAX_SPAN_S or later; bright those with a channel above LARGEST_COLOUR.
    """
    low, high, latest, bad, bright = 255, 0, np.float32(0.0), 0, 0
    for k in range(samples.shape[0]):
        r, g, b = samples[k]["radiance"][0], samples[k]["radiance"][1], samples[k]["radiance"][2]
        depth, time = samples[k]["depth"], samples[k]["time"]
        finite = abs(r) < np.inf and abs(g) < np.inf and abs(b) < np.inf
        if not (finite and depth >= 0.0 and time >= 0.0 and time < MAX_SPAN_S):
            bad += 1
            continue
        if r > LARGEST_COLOUR or g > LARGEST_COLOUR or b > LARGEST_COLOUR:
            bright += 1
        latest = max(latest, time)
        exponent = np.int64(np.float32(depth).view(np.int32) >> 23)
        if exponent < 255:
            low, high = min(low, max(exponent, 1)), max(high, max(exponent, 1))
    return low, high, latest, bad, bright


@bit_kernel
def pack(samples, rect, scales, planes):
    """Quantise samples but their object ids; see docs/guide/packet_format.md for the layout and the error bounds.

    Parameters
    ----------
    samples : (n,) SAMPLE, inside the rectangle, usable (see depth_range)
    rect : (x, y, width, height), panel pixels
    scales : Scales
    planes : Planes of n numbers; all but `objects` are written, `depths` only if there are any

    Returns
    -------
    outside : int, samples that are not in the rectangle (they are put in its corner)
    """
    outside = 0
    x0, y0, width, height = rect
    x_scale, y_scale = np.float32(1 << scales.x_bits), np.float32(1 << scales.y_bits)
    shift = 23 - scales.depth_bits
    half = (1 << shift) >> 1
    origin = scales.depth_base << 23
    span = np.float32(scales.time_span)
    per_second = np.float32(0.0) if span < SHORTEST_SPAN_S else np.float32(TIME_STEPS) / span
    deep = planes.depths.shape[0] > 0
    for k in range(samples.shape[0]):
        r, g, b = samples[k]["radiance"][0], samples[k]["radiance"][1], samples[k]["radiance"][2]
        planes.colours[k] = shared_exponent(r, g, b)
        dx, dy = samples[k]["xy"][0] - np.float32(x0), samples[k]["xy"][1] - np.float32(y0)
        if not (dx >= 0.0 and dy >= 0.0 and dx < width and dy < height):  # NaN too
            outside += 1
            dx, dy = np.float32(0.0), np.float32(0.0)
        time = np.int32(samples[k]["time"] * per_second + np.float32(0.5))
        time = np.int32(min(max(time, 0), TIME_STEPS))
        planes.xs[k] = np.uint16(np.int32(dx * x_scale) | (time << POSITION_BITS))
        planes.ys[k] = np.uint16(np.int32(dy * y_scale))
        if not deep:
            continue
        bits = np.int64(np.float32(samples[k]["depth"]).view(np.int32))
        if bits >= INFINITY_BITS:
            planes.depths[k] = np.uint16(INFINITE_DEPTH)
        else:
            planes.depths[k] = np.uint16((max(bits, origin) - origin + half) >> shift)
    return outside


@bit_kernel
def unpack(planes, rect, scales, samples):
    """The inverse of pack(). rect : (x, y, width, height). Returns how many positions lie outside the rectangle.

    Depths that were not sent are infinite.
    """
    outside, deep = 0, planes.depths.shape[0] > 0
    x0, y0, width, height = rect
    x_step, y_step = np.float32(1.0 / (1 << scales.x_bits)), np.float32(1.0 / (1 << scales.y_bits))
    shift, origin = 23 - scales.depth_bits, scales.depth_base << 23
    step = np.float32(scales.time_span) / np.float32(TIME_STEPS)
    for k in range(samples.shape[0]):
        word = planes.colours[k]
        exponent = np.int32(word >> np.uint32(27))
        scale = np.int32((103 + exponent) << 23).view(np.float32)  # 2^(exponent - 24)
        samples[k]["radiance"][0] = np.float32(word & np.uint32(511)) * scale
        samples[k]["radiance"][1] = np.float32((word >> np.uint32(9)) & np.uint32(511)) * scale
        samples[k]["radiance"][2] = np.float32((word >> np.uint32(18)) & np.uint32(511)) * scale
        x, y = np.int32(planes.xs[k]), np.int32(planes.ys[k])
        px = np.float32(x0) + np.float32(x & POSITION_MASK) * x_step
        py = np.float32(y0) + np.float32(y) * y_step
        if px >= x0 + width or py >= y0 + height:  # after rounding to float32: that may reach the far edge
            outside += 1
        samples[k]["xy"][0], samples[k]["xy"][1] = px, py
        samples[k]["time"] = np.float32(x >> POSITION_BITS) * step
        depth = np.int64(planes.depths[k]) if deep else np.int64(INFINITE_DEPTH)
        if depth == INFINITE_DEPTH:
            samples[k]["depth"] = np.float32(np.inf)
        else:
            bits = min((depth << shift) + origin, LARGEST_FINITE_BITS)
            samples[k]["depth"] = np.int32(bits).view(np.float32)
    return outside
