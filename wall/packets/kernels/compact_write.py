"""Write samples as planes of small numbers and read them back: sorted by place, told by their differences."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.packets.kernels.bit_planes import bits_of, folded, put_all, put_plane
from wall.packets.kernels.fixed import LARGEST_COLOUR, LARGEST_OBJECT, SHORTEST_SPAN_S, depth_range
from wall.packets.kernels.normals import exchange, flag_facing, hidden_lights, normal_code, put_facing

SUBPIXEL_BITS = 3
DEPTH_BITS = 11  # mantissa bits of a depth code
OBJECT_BITS = 14
TIME_STEPS, CHANGE_STEPS = 63, 15
TILE_BITS, TILE = 4, 16  # pixels
TOP_CODE = 1535  # of colours, see tables.py
DARK_BITS = 115 << 23  # of float32 2^-12
BUCKET_SHIFT = 16
COUNT_BITS = 17  # of tiles and of objects, each at most 65,536
FLAG_BITS, LIT_FLAG_BITS = 3, 5  # with normals and lamps: see facing
MIXED_OBJECTS, MIXED_TIMES, CHANGED = 1, 2, 4  # flags of a tile
WORDS_A_SAMPLE = 17  # at worst, alone in its tile: fourteen escaped numbers, 12 + 14 bits more
WORDS_BESIDE = 3
TILES, COUNTS, NAMES, GAPS, WHO, TIMES, CHANGES, LUMA, ORANGE, GREEN, DEPTHS = range(11)  # planes of numbers
MEANS = np.array([4, 4, 8, 16, 1, 4, 2, 16, 8, 4, 64], np.int64)  # before the first number of each
LOW_32 = np.uint64(0xFFFFFFFF)
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@inline_kernel
def noise_of(x, y):
    """30 random bits of sub-pixel (x, y), ten for each colour channel."""
    h = (np.uint64((x << 16) | y) * np.uint64(0x9E3779B1)) & LOW_32
    h ^= h >> np.uint64(15)
    h = (h * np.uint64(0x85EBCA77)) & LOW_32
    h ^= h >> np.uint64(13)
    return np.int64(h)


@inline_kernel
def noise(bits):
    """float32 inside (0, 1): odd multiples of 1/2048."""
    return (np.float32(bits & 1023) + HALF) * np.float32(1.0 / 1024.0)


@inline_kernel
def colour_code(value, lift, colour_of_code, code_of_bucket):
    """The code of a channel: floor(its place on the curve + lift)."""
    value = min(max(value, ZERO), np.float32(LARGEST_COLOUR))
    bits = max(np.int64(np.float32(value).view(np.int32)) - DARK_BITS, 0)
    code = np.int64(code_of_bucket[bits >> BUCKET_SHIFT])
    code += np.int64(colour_of_code[code + 1, 0] <= value)
    place = (value - colour_of_code[code, 0]) * colour_of_code[code, 1]
    return min(code + np.int64(place + lift), TOP_CODE)


@inline_kernel
def colour_of(code, lift, colour_of_code):
    """The inverse: the middle of all colours that `lift` takes to this code."""
    place = np.float32(code) + (HALF - lift)
    place = min(max(place, ZERO), np.float32(TOP_CODE))
    whole = np.int64(place)
    low = colour_of_code[whole, 0]
    return low + (place - np.float32(whole)) * (colour_of_code[whole + 1, 0] - low)


@kernel
def sorted_order(keys):
    """(n,) int64: a stable order of keys (n,) uint32, by as many digits of 8 bits as the largest one has."""
    n = keys.shape[0]
    order, other = np.arange(n), np.empty(n, np.int64)
    starts = np.empty(256, np.int64)
    top = np.int64(0)
    for i in range(n):
        top = max(top, np.int64(keys[i]))
    shift = 0
    while top >> shift > 0:
        starts[:] = 0
        for i in range(n):
            starts[(np.int64(keys[i]) >> shift) & 255] += 1
        total = np.int64(0)
        for digit in range(256):
            count = starts[digit]
            starts[digit] = total
            total += count
        for i in range(n):
            k = order[i]
            digit = (np.int64(keys[k]) >> shift) & 255
            other[starts[digit]] = k
            starts[digit] += 1
        order, other = other, order
        shift += 8
    return order


@kernel
def places(samples, rect, place_on_curve, keys, subpixels):
    """Where samples (n,) SAMPLE are: keys (n,) uint32 and x, y in sub-pixels (n, 2) int32 are written.

    A key is a tile's number (row by row and back), then the pixel's place on the tile's curve in 8 bits. Returns how
    many samples are not in the rectangle.
    """
    x0, y0, width, height = rect
    tile_columns = (width + TILE - 1) >> TILE_BITS
    scale = np.float32(1 << SUBPIXEL_BITS)
    outside = 0
    for k in range(samples.shape[0]):
        dx, dy = samples[k]["xy"][0] - np.float32(x0), samples[k]["xy"][1] - np.float32(y0)
        if not (dx >= 0.0 and dy >= 0.0 and dx < width and dy < height):  # NaN too
            outside += 1
            dx, dy = ZERO, ZERO
        x, y = np.int64(dx * scale), np.int64(dy * scale)
        i, j = y >> SUBPIXEL_BITS, x >> SUBPIXEL_BITS
        row, column = i >> TILE_BITS, j >> TILE_BITS
        if row & 1:
            column = tile_columns - 1 - column
        place = place_on_curve[((i & (TILE - 1)) << TILE_BITS) | (j & (TILE - 1))]
        keys[k] = ((row * tile_columns + column) << 8) | np.int64(place)
        subpixels[k, 0], subpixels[k, 1] = x, y
    return outside


@kernel
def codes(samples, order, subpixels, base, span, tables, columns):
    """Quantise samples (n,) SAMPLE in some order.

    base : float32 exponent of depth code 1; span : float32 seconds of time code 63
    columns : (7, n) int32, written: luma, orange, green, depth, object, time, change; (10, n): also normal (2) and
        hidden lights
    """
    _, _, colour_of_code, code_of_bucket = tables
    per_second = ZERO if span < SHORTEST_SPAN_S else np.float32(TIME_STEPS) / span
    shift, origin = 23 - DEPTH_BITS, base << 23
    for i in range(order.shape[0]):
        k = order[i]
        lift = noise_of(np.int64(subpixels[k, 0]), np.int64(subpixels[k, 1]))
        red = colour_code(samples[k]["radiance"][0], noise(lift), colour_of_code, code_of_bucket)
        green = colour_code(samples[k]["radiance"][1], noise(lift >> 10), colour_of_code, code_of_bucket)
        blue = colour_code(samples[k]["radiance"][2], noise(lift >> 20), colour_of_code, code_of_bucket)
        orange = red - blue  # YCoCg-R (Malvar, Sullivan 2003): whole numbers, reversible
        middle = blue + (orange >> 1)
        columns[0, i], columns[1, i], columns[2, i] = middle + ((green - middle) >> 1), orange, green - middle
        bits = np.int64(np.float32(samples[k]["depth"]).view(np.int32))
        depth = 1 + ((max(bits, origin) - origin + ((1 << shift) >> 1)) >> shift)
        columns[3, i] = depth if bits < 0x7F800000 else 0
        name = np.int64(samples[k]["object_id"])
        if name > LARGEST_OBJECT:
            name = (name - 1) % LARGEST_OBJECT + 1
        columns[4, i] = name
        columns[5, i] = min(max(np.int64(samples[k]["time"] * per_second + HALF), 0), TIME_STEPS)
        columns[6, i] = np.int64(min(max(samples[k]["change"], ZERO), ONE) * np.float32(CHANGE_STEPS) + HALF)
        if columns.shape[0] > 7:
            columns[7, i] = normal_code(samples[k]["normal"][0])
            columns[8, i] = normal_code(samples[k]["normal"][1])
            columns[9, i] = hidden_lights(samples[k])


@kernel
def palette_of(names, index_of):
    """The distinct of names (n,), growing.

    index_of : (2^14,) int16 of -1, written: the place of each name in the palette
    """
    found = np.empty(names.shape[0], np.uint32)
    count = 0
    for i in range(names.shape[0]):
        if index_of[names[i]] < 0:
            index_of[names[i]] = 0
            found[count] = names[i]
            count += 1
    palette = found[:count][sorted_order(found[:count])]
    for place in range(count):
        index_of[palette[place]] = place
    return palette


@kernel
def differences(who, columns, known):
    """columns (c, n) int32: to the last sample of the same object, or of any while there is none; folded, in place.

    who : (n,) int32, places in the palette; known : (palette's size,) of objects
    """
    last = np.empty((known, columns.shape[0]), np.int64)
    seen = np.zeros(known, np.bool_)
    before = np.int64(0)
    for i in range(who.shape[0]):
        mine = np.int64(who[i])
        if not seen[mine]:
            seen[mine] = True
            for c in range(columns.shape[0]):
                last[mine, c] = last[before, c] if i > 0 else 0
        for c in range(columns.shape[0]):
            value = np.int64(columns[c, i])
            columns[c, i] = folded(value - last[mine, c])
            last[mine, c] = value
        before = mine


@kernel
def write(keys, order, subpixels, columns, words):
    """Write quantised samples (see codes) that are in some order of growing keys. Returns the number of words."""
    n = order.shape[0]
    at = np.zeros(3, np.int64)
    tiles, counts, flags = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int32)
    begins = np.zeros(n + 1, np.int64)
    gaps, inside = np.empty(n, np.int32), np.empty(n, np.int32)
    symbols, indices = np.empty(n, np.int32), np.empty(n, np.int32)
    times, changes = np.empty(n, np.int32), np.empty(n, np.int32)
    index_of = np.full(1 << OBJECT_BITS, -1, np.int16)
    palette = palette_of(columns[4], index_of)
    who = np.empty(n, np.int32)
    for i in range(n):
        who[i] = index_of[columns[4, i]]
        k = order[i]
        inside[i] = ((subpixels[k, 1] & 7) << SUBPIXEL_BITS) | (subpixels[k, 0] & 7)
    m = told = listed = timed = changed = begin = 0
    tile_before, count_before, time_before = np.int64(-1), np.int64(TILE), np.int64(0)
    this = other = np.int64(-1)
    while begin < n:
        tile, end = np.int64(keys[order[begin]]) >> 8, begin
        differ_who = differ_time = any_change = np.int64(0)
        spot = np.int64(0)
        while end < n and np.int64(keys[order[end]]) >> 8 == tile:
            here = np.int64(keys[order[end]]) & 255
            gaps[end], spot = here - spot, here
            differ_who |= who[end] ^ who[begin]
            differ_time |= columns[5, end] ^ columns[5, begin]
            any_change |= columns[6, end]
            end += 1
        flag = (MIXED_OBJECTS if differ_who else 0) | (MIXED_TIMES if differ_time else 0)
        flag |= CHANGED if any_change else 0
        tiles[m], counts[m], flags[m] = tile - tile_before - 1, folded(np.int64(end - begin) - count_before), flag
        tile_before, count_before = tile, np.int64(end - begin)
        m += 1
        begins[m] = end
        for i in range(begin, end if differ_who else begin + 1):
            mine = np.int64(who[i])
            symbols[told] = 0 if mine == this else (1 if mine == other else 2)
            if mine != this and mine != other:
                indices[listed] = mine
                listed += 1
            if mine != this:
                this, other = mine, this
            told += 1
        for i in range(begin, end if differ_time else begin + 1):
            times[timed] = folded(np.int64(columns[5, i]) - time_before)
            time_before = np.int64(columns[5, i])
            timed += 1
        if any_change:
            for i in range(begin, end):
                changes[changed] = columns[6, i]
                changed += 1
        begin = end
    differences(who, columns[:4], palette.shape[0])
    facing = columns[7:]
    if facing.shape[0] > 0:
        differences(who, facing[:2], palette.shape[0])
        exchange(who, facing[2], palette.shape[0], False)
        flag_facing(facing, begins, flags[:m])
    put_all(np.array([m, palette.shape[0]]), COUNT_BITS, words, at)
    put_plane(tiles[:m], MEANS[TILES], words, at)
    put_plane(counts[:m], MEANS[COUNTS], words, at)
    put_all(flags[:m], LIT_FLAG_BITS if facing.shape[0] > 0 else FLAG_BITS, words, at)
    for place in range(palette.shape[0] - 1, 0, -1):
        palette[place] -= palette[place - 1] + np.uint32(1)
    put_plane(palette, MEANS[NAMES], words, at)
    put_plane(gaps, MEANS[GAPS], words, at)
    put_all(inside, 2 * SUBPIXEL_BITS, words, at)
    put_plane(symbols[:told], MEANS[WHO], words, at)
    put_all(indices[:listed], bits_of(palette.shape[0] - 1), words, at)
    put_plane(times[:timed], MEANS[TIMES], words, at)
    put_plane(changes[:changed], MEANS[CHANGES], words, at)
    for c in range(4):
        put_plane(columns[c], MEANS[LUMA + c], words, at)
    if facing.shape[0] > 0:
        put_facing(facing, begins, flags[:m], words, at)
    if at[1] > 0:
        words[at[2]] = np.uint32(at[0])
        at[2] += 1
    return at[2]


@kernel
def encode(samples, rect, lit, tables, words):
    """Write samples (n,) SAMPLE.

    rect : (x, y, width, height), panel pixels; lit : bool, with normals and lamps; tables : see tables.Tables
    words : (WORDS_A_SAMPLE * n + WORDS_BESIDE,) uint32, written

    Returns
    -------
    written, base, latest, bad, outside : words; depth base; seconds of time code 63; samples that are not usable (see
    depth_range) or not in the rectangle, with any of which nothing is written
    """
    n = samples.shape[0]
    low, high, latest, bad = depth_range(samples)
    base = low if low <= high else 0
    keys, subpixels = np.empty(n, np.uint32), np.empty((n, 2), np.int32)
    outside = places(samples, rect, tables[0], keys, subpixels)
    if bad or outside:
        return np.int64(0), base, latest, bad, outside
    order, columns = sorted_order(keys), np.empty((10 if lit else 7, n), np.int32)
    codes(samples, order, subpixels, base, latest, tables, columns)
    return write(keys, order, subpixels, columns, words), base, latest, bad, outside
