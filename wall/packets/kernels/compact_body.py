"""Samples as columns of small whole numbers, and back: sorted by object and position, told by their differences."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.packets.kernels.colour_codes import TOP_CODE, code_of, colour_of, dither, dither_bits
from wall.packets.kernels.normals import NORMAL_CODES, normal_code, normal_of
from wall.packets.kernels.plain_body import INFINITY_BITS, LARGEST_FINITE_BITS, SHORTEST_SPAN_S, depth_range

POSITION, LUMA, CO, CG, DEPTH, TIME, CHANGE, NORMAL_X, NORMAL_Y, SURFACE = range(10)  # columns; YCoCg-R
COLUMNS, SURFACE_COLUMNS = 7, 10  # without and with normals, and light visibility masks or albedos
SUBPIXEL_BITS = 3
DEPTH_BITS = 11  # mantissa bits of a depth code
TIME_STEPS, CHANGE_STEPS = 63, 15
DIGIT_BITS, DIGITS = 8, 256  # of the radix sort
LARGEST_ID = 0xFFFFFFFF
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@inline_kernel
def spread_bits(number):
    """Bit k of a number of 16 bits goes to bit 2 k."""
    number = (number | (number << 8)) & 0x00FF00FF
    number = (number | (number << 4)) & 0x0F0F0F0F
    number = (number | (number << 2)) & 0x33333333
    return (number | (number << 1)) & 0x55555555


@inline_kernel
def gather_bits(number):
    """The inverse of spread_bits(); odd bits are ignored."""
    number &= 0x55555555
    number = (number | (number >> 1)) & 0x33333333
    number = (number | (number >> 2)) & 0x0F0F0F0F
    number = (number | (number >> 4)) & 0x00FF00FF
    return (number | (number >> 8)) & 0x0000FFFF


@inline_kernel
def zigzag(number):
    """Zigzag code of a signed number: 0, -1, 1, -2, 2 ... become 0, 1, 2, 3, 4."""
    return (number << 1) ^ (number >> 63)


@inline_kernel
def undo_zigzag(number):
    """The inverse of zigzag()."""
    return (number >> 1) ^ -(number & 1)


@kernel
def sorted_by(keys, order):
    """`order` (n,) int64 of indices, sorted stably by keys (m,) uint32 of what they point to."""
    other, starts = np.empty_like(order), np.empty(DIGITS, np.int64)
    top = np.int64(0)
    for k in range(keys.shape[0]):
        top = max(top, np.int64(keys[k]))
    shift = 0
    while top >> shift > 0:
        starts[:] = 0
        for k in range(keys.shape[0]):
            starts[(np.int64(keys[k]) >> shift) & (DIGITS - 1)] += 1
        total = np.int64(0)
        for digit in range(DIGITS):
            count = starts[digit]
            starts[digit] = total
            total += count
        for i in range(order.shape[0]):
            digit = (np.int64(keys[order[i]]) >> shift) & (DIGITS - 1)
            other[starts[digit]] = order[i]
            starts[digit] += 1
        order, other = other, order
        shift += DIGIT_BITS
    return order


@kernel
def find_keys(samples, rect, positions, ids):
    """Morton codes (Z-order) of sub-pixels, and object ids.

    samples : (n,) SAMPLE; rect : (x, y, width, height), panel pixels; positions, ids : (n,) uint32, written.
    Returns how many samples are not in the rectangle.
    """
    x0, y0, width, height = rect
    scale = np.float32(1 << SUBPIXEL_BITS)
    outside = 0
    for k in range(samples.shape[0]):
        dx, dy = samples[k]["xy"][0] - np.float32(x0), samples[k]["xy"][1] - np.float32(y0)
        if not (dx >= 0.0 and dy >= 0.0 and dx < width and dy < height):  # NaN too
            outside += 1
            dx, dy = ZERO, ZERO
        positions[k] = spread_bits(np.int64(dx * scale)) | (spread_bits(np.int64(dy * scale)) << 1)
        ids[k] = samples[k]["object_id"]
    return outside


@kernel
def encode(samples, rect, curve, noisy, columns, objects):
    """Quantise, sort and take differences.

    Parameters
    ----------
    samples : (n,) SAMPLE; rect : (x, y, width, height), panel pixels; curve : ColourCurve
    noisy : bool, column SURFACE is of albedos, else of light visibility masks
    columns : (COLUMNS or SURFACE_COLUMNS, n) int32, written
    objects : (2, n) uint32, written: ids, each less the one before, and their numbers of samples

    Returns
    -------
    known, base, latest, bad, outside, bright : objects; depth base; seconds of the last time code; samples that are not
    usable or not in the rectangle, with any of which nothing is written; samples with too much light (see depth_range)
    """
    n = samples.shape[0]
    low, high, latest, bad, bright = depth_range(samples)
    base = low if low <= high else 0
    positions, ids = np.empty(n, np.uint32), np.empty(n, np.uint32)
    outside = find_keys(samples, rect, positions, ids)
    if bad or outside:
        return np.int64(0), base, latest, bad, outside, bright
    order = sorted_by(ids, sorted_by(positions, np.arange(n)))
    per_second = ZERO if latest < SHORTEST_SPAN_S else np.float32(TIME_STEPS) / latest
    shift, origin = 23 - DEPTH_BITS, base << 23
    known, before_id, before_position = np.int64(0), np.int64(-1), np.int64(0)
    for i in range(n):
        k = order[i]
        object_id, position = np.int64(ids[k]), np.int64(positions[k])
        if object_id != before_id:
            objects[0, known] = object_id - max(before_id, 0)
            objects[1, known] = 0
            known += 1
            before_id, before_position = object_id, np.int64(0)
        objects[1, known - 1] += np.uint32(1)
        columns[POSITION, i] = position - before_position
        before_position = position
        noise = dither_bits(gather_bits(position), gather_bits(position >> 1))
        red = code_of(samples[k]["radiance"][0], dither(noise), curve)
        green = code_of(samples[k]["radiance"][1], dither(noise >> 10), curve)
        blue = code_of(samples[k]["radiance"][2], dither(noise >> 20), curve)
        co = red - blue  # YCoCg-R (Malvar, Sullivan 2003): whole numbers, reversible
        middle = blue + (co >> 1)
        columns[LUMA, i] = middle + ((green - middle) >> 1)
        columns[CO, i], columns[CG, i] = co, green - middle
        bits = np.int64(np.float32(samples[k]["depth"]).view(np.int32))
        depth = 1 + ((max(bits, origin) - origin + ((1 << shift) >> 1)) >> shift)
        columns[DEPTH, i] = depth if bits < INFINITY_BITS else 0
        columns[TIME, i] = min(max(np.int64(samples[k]["time"] * per_second + HALF), 0), TIME_STEPS)
        columns[CHANGE, i] = np.int64(min(max(samples[k]["change"], ZERO), ONE) * np.float32(CHANGE_STEPS) + HALF)
        if columns.shape[0] > COLUMNS:
            columns[NORMAL_X, i] = normal_code(samples[k]["normal"][0])
            columns[NORMAL_Y, i] = normal_code(samples[k]["normal"][1])
            surface = samples[k]["albedo"] if noisy else samples[k]["light_visibility"]
            columns[SURFACE, i] = np.uint32(surface).view(np.int32)
    for c in range(LUMA, columns.shape[0]):
        if c == SURFACE:
            take_changed_bits(columns[c])
        elif c != CHANGE:
            take_differences(columns[c])
    return known, base, latest, bad, outside, bright


@inline_kernel
def take_differences(column):
    """column (n,) int32 in place: zigzag codes of differences to the number before; before the first: 0."""
    for i in range(column.shape[0] - 1, 0, -1):
        column[i] = zigzag(np.int64(column[i]) - np.int64(column[i - 1]))
    if column.shape[0] > 0:
        column[0] = zigzag(np.int64(column[0]))


@inline_kernel
def take_changed_bits(column):
    """column (n,) int32 in place: exclusive or with the mask before; before the first: all bits set."""
    for i in range(column.shape[0] - 1, 0, -1):
        column[i] ^= column[i - 1]
    if column.shape[0] > 0:
        column[0] ^= np.int32(-1)


@kernel
def decode(columns, objects, rect, depth_code, span, curve, noisy, samples):
    """Read samples back, by object and position.

    Parameters
    ----------
    columns : (COLUMNS or SURFACE_COLUMNS, n) uint32; objects : (2, m) uint32; both hold anything
    rect : (x, y, width, height), panel pixels; depth_code : (base, mantissa bits) of depth codes
    span : float32 seconds, of time code TIME_STEPS; curve : ColourCurve; noisy : see encode
    samples : (n,) SAMPLE, written

    Returns
    -------
    whole : bool, whether every number is in range
    """
    n, described = samples.shape[0], columns.shape[0] > COLUMNS
    shift, origin = 23 - depth_code[1], depth_code[0] << 23
    deepest = 1 + ((INFINITY_BITS - origin) >> shift)
    subpixel, time_step = np.float32(1.0 / (1 << SUBPIXEL_BITS)), np.float32(span) / np.float32(TIME_STEPS)
    luma = co = cg = depth = time = normal_x = normal_y = np.int64(0)
    surface = np.uint32(0xFFFFFFFF)
    i, object_id = np.int64(0), np.int64(0)
    for m in range(objects.shape[1]):
        object_id += np.int64(objects[0, m])
        end, position = i + np.int64(objects[1, m]), np.int64(0)
        if object_id > LARGEST_ID or (m > 0 and objects[0, m] == 0) or end == i or end > n:
            return False
        while i < end:
            position += np.int64(columns[POSITION, i])
            x, y = gather_bits(position), gather_bits(position >> 1)
            luma += undo_zigzag(np.int64(columns[LUMA, i]))
            co += undo_zigzag(np.int64(columns[CO, i]))
            cg += undo_zigzag(np.int64(columns[CG, i]))
            depth += undo_zigzag(np.int64(columns[DEPTH, i]))
            time += undo_zigzag(np.int64(columns[TIME, i]))
            change = np.int64(columns[CHANGE, i])
            middle = luma - (cg >> 1)
            g = middle + cg
            b = middle - (co >> 1)
            r = b + co
            if position >> 32 or x >> SUBPIXEL_BITS >= rect[2] or y >> SUBPIXEL_BITS >= rect[3]:
                return False
            if min(r, min(g, b)) < 0 or max(r, max(g, b)) > TOP_CODE or depth < 0 or depth > deepest:
                return False
            if time < 0 or time > TIME_STEPS or change > CHANGE_STEPS:
                return False
            if described:
                normal_x += undo_zigzag(np.int64(columns[NORMAL_X, i]))
                normal_y += undo_zigzag(np.int64(columns[NORMAL_Y, i]))
                surface ^= np.uint32(columns[SURFACE, i])
                if max(abs(normal_x), abs(normal_y)) > NORMAL_CODES:
                    return False
            noise = dither_bits(x, y)
            samples[i]["xy"][0] = np.float32(rect[0]) + (np.float32(x) + HALF) * subpixel
            samples[i]["xy"][1] = np.float32(rect[1]) + (np.float32(y) + HALF) * subpixel
            samples[i]["radiance"][0] = colour_of(r, dither(noise), curve)
            samples[i]["radiance"][1] = colour_of(g, dither(noise >> 10), curve)
            samples[i]["radiance"][2] = colour_of(b, dither(noise >> 20), curve)
            bits = min((max(depth - 1, 0) << shift) + origin, LARGEST_FINITE_BITS)
            samples[i]["depth"] = np.float32(np.inf) if depth == 0 else np.int32(bits).view(np.float32)
            samples[i]["time"] = np.float32(time) * time_step
            samples[i]["object_id"] = np.uint32(object_id)
            samples[i]["sqrt_irradiance"] = ZERO
            samples[i]["change"] = np.float32(change) / np.float32(CHANGE_STEPS)
            samples[i]["normal"][0], samples[i]["normal"][1] = normal_of(normal_x), normal_of(normal_y)
            samples[i]["light_visibility"] = surface if described and not noisy else np.uint32(0)
            samples[i]["albedo"] = surface if described and noisy else np.uint32(0)
            i += 1
    return i == n
