"""Pack samples into 12 bytes and back, one pass each; only integer operations on the float's own bits."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel

POSITION_BITS = 14
POSITION_MASK = 0x3FFF
INFINITE_DEPTH = 0xFFFF
LARGEST_OBJECT = 16383  # 14 bits; larger ids wrap to 1..16383, never to the background's 0
TIME_STEPS = 3  # 2 bits
CHANGE_STEPS = 15  # 4 bits
MAX_SPAN_S = 1e6  # a packet's times span less
SHORTEST_SPAN_S = 1e-30  # shorter ones count as 0: 63 / span would overflow
LARGEST_COLOUR = 65408.0  # 511/512 * 2^16, the largest value of the shared-exponent format


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
    """The smallest and largest float32 exponent of the finite depths, the latest time, how many samples are unusable.

    samples : (n,) SAMPLE. Returns (low, high, latest, bad): low > high if no depth is finite; latest in seconds after
    the base time, 0 for n = 0; bad counts samples whose radiance is not finite, or whose depth or time is negative or
    NaN, or whose time is MAX_SPAN_S or later.
    """
    low, high, latest, bad = 255, 0, np.float32(0.0), 0
    for k in range(samples.shape[0]):
        r, g, b = samples[k]["radiance"][0], samples[k]["radiance"][1], samples[k]["radiance"][2]
        depth, time = samples[k]["depth"], samples[k]["time"]
        finite = abs(r) < np.inf and abs(g) < np.inf and abs(b) < np.inf
        if not (finite and depth >= 0.0 and time >= 0.0 and time < MAX_SPAN_S):
            bad += 1
            continue
        latest = max(latest, time)
        exponent = np.int64(np.float32(depth).view(np.int32) >> 23)
        if exponent < 255:
            low, high = min(low, max(exponent, 1)), max(high, max(exponent, 1))
    return low, high, latest, bad


@kernel
def pack(samples, rect, x_bits, y_bits, depth_base, depth_bits, time_span, colour, xs, ys, depths, objects):
    """Quantise samples; see docs/guide/packet_format.md for the layout and the error bounds.

    Parameters
    ----------
    samples : (n,) SAMPLE, inside the rectangle, usable (see depth_range)
    rect : (x, y, width, height), panel pixels; x_bits, y_bits : sub-pixel bits
    depth_base, depth_bits : exponent of depth code 0, mantissa bits
    time_span : float32 seconds, of time code 3
    colour : (n,) uint32; xs, ys, depths, objects : (n,) uint16; written

    Returns
    -------
    outside : int, samples that are not in the rectangle (they are put in its corner)
    """
    outside = 0
    x0, y0, width, height = rect
    x_scale, y_scale = np.float32(1 << x_bits), np.float32(1 << y_bits)
    shift = 23 - depth_bits
    half = (1 << shift) >> 1
    origin = depth_base << 23
    per_second = np.float32(0.0) if time_span < SHORTEST_SPAN_S else np.float32(TIME_STEPS) / time_span
    for k in range(samples.shape[0]):
        colour[k] = shared_exponent(samples[k]["radiance"][0], samples[k]["radiance"][1], samples[k]["radiance"][2])
        dx, dy = samples[k]["xy"][0] - np.float32(x0), samples[k]["xy"][1] - np.float32(y0)
        if not (dx >= 0.0 and dy >= 0.0 and dx < width and dy < height):  # NaN too
            outside += 1
            dx, dy = np.float32(0.0), np.float32(0.0)
        x, y = np.int32(dx * x_scale), np.int32(dy * y_scale)
        time = np.int32(samples[k]["time"] * per_second + np.float32(0.5))
        time = np.int32(min(max(time, 0), TIME_STEPS))
        change = min(max(samples[k]["change"], np.float32(0.0)), np.float32(1.0))
        change = np.int32(change * np.float32(CHANGE_STEPS) + np.float32(0.5))
        xs[k] = np.uint16(x | ((change >> 2) << POSITION_BITS))
        ys[k] = np.uint16(y | ((change & 3) << POSITION_BITS))
        bits = np.int64(np.float32(samples[k]["depth"]).view(np.int32))
        if bits >= 0x7F800000:
            depths[k] = np.uint16(INFINITE_DEPTH)
        else:
            depths[k] = np.uint16((max(bits, origin) - origin + half) >> shift)
        name = np.int64(samples[k]["object_id"])
        if name > LARGEST_OBJECT:
            name = (name - 1) % LARGEST_OBJECT + 1
        objects[k] = np.uint16(name | (time << POSITION_BITS))
    return outside


@kernel
def unpack(colour, xs, ys, depths, objects, rect, x_bits, y_bits, depth_base, depth_bits, time_span, samples):
    """The inverse of pack(). rect : (x, y, width, height). Returns how many positions lie outside the rectangle."""
    outside = 0
    x0, y0, width, height = rect
    x_step, y_step = np.float32(1.0 / (1 << x_bits)), np.float32(1.0 / (1 << y_bits))
    shift, origin = 23 - depth_bits, depth_base << 23
    step = np.float32(time_span) / np.float32(TIME_STEPS)
    for k in range(samples.shape[0]):
        word = colour[k]
        exponent = np.int32(word >> np.uint32(27))
        scale = np.int32((103 + exponent) << 23).view(np.float32)  # 2^(exponent - 24)
        samples[k]["radiance"][0] = np.float32(word & np.uint32(511)) * scale
        samples[k]["radiance"][1] = np.float32((word >> np.uint32(9)) & np.uint32(511)) * scale
        samples[k]["radiance"][2] = np.float32((word >> np.uint32(18)) & np.uint32(511)) * scale
        x, y, name = np.int32(xs[k]), np.int32(ys[k]), np.int32(objects[k])
        dx, dy = np.float32(x & POSITION_MASK) * x_step, np.float32(y & POSITION_MASK) * y_step
        px, py = np.float32(x0) + dx, np.float32(y0) + dy
        if px >= x0 + width or py >= y0 + height:  # after rounding to float32: that may reach the far edge
            outside += 1
        samples[k]["xy"][0] = px
        samples[k]["xy"][1] = py
        samples[k]["time"] = np.float32(name >> POSITION_BITS) * step
        change = ((x >> POSITION_BITS) << 2) | (y >> POSITION_BITS)
        samples[k]["change"] = np.float32(change) / np.float32(CHANGE_STEPS)
        samples[k]["lighting"] = np.float32(0.0)
        samples[k]["object_id"] = np.uint32(name & POSITION_MASK)
        if depths[k] == INFINITE_DEPTH:
            samples[k]["depth"] = np.float32(np.inf)
        else:
            samples[k]["depth"] = np.int32(min((np.int64(depths[k]) << shift) + origin, 0x7F7FFFFF)).view(np.float32)
    return outside
