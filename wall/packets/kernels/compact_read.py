"""Read samples back from planes of small numbers; the inverse of kernels.py."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel
from wall.packets.kernels.bit_planes import (
    bits_of,
    get_all,
    get_plane,
    unfolded,
)
from wall.packets.kernels.compact_write import (
    CHANGE_STEPS,
    CHANGED,
    CHANGES,
    COUNT_BITS,
    COUNTS,
    FLAG_BITS,
    GAPS,
    HALF,
    LIT_FLAG_BITS,
    LUMA,
    MEANS,
    MIXED_OBJECTS,
    MIXED_TIMES,
    NAMES,
    SUBPIXEL_BITS,
    TILE,
    TILE_BITS,
    TILES,
    TIME_STEPS,
    TIMES,
    TOP_CODE,
    WHO,
    ZERO,
    colour_of,
    noise,
    noise_of,
)
from wall.packets.kernels.fixed import LARGEST_OBJECT
from wall.packets.kernels.normals import exchange, read_facing, restore_facing


@kernel
def summed(numbers, first, step):
    """numbers (n,) int32 become running sums, int64: first + number + step, and so on."""
    sums, total = np.empty(numbers.shape[0], np.int64), np.int64(first)
    for i in range(numbers.shape[0]):
        total += np.int64(numbers[i]) + step
        sums[i] = total
    return sums


@kernel
def read_tiles(words, position, head, tiles, starts, flags):
    """Read numbers (m,), first samples (m + 1,) and flags (m,) of tiles; returns the position, -1 if out of range.

    head : (tiles of the rectangle, samples of the packet, bits of flags)
    """
    m = tiles.shape[0]
    counts = np.empty(m, np.int32)
    position = get_plane(tiles, MEANS[TILES], words, position)
    position = get_plane(counts, MEANS[COUNTS], words, position)
    position = get_all(flags, head[2], words, position)
    tile, count, total = np.int64(-1), np.int64(TILE), np.int64(0)
    for t in range(m):
        tile, count = tile + 1 + tiles[t], count + unfolded(np.int64(counts[t]))
        starts[t] = total
        total += count
        if tile >= head[0] or count < 1 or total > head[1]:
            return np.int64(-1)
        tiles[t] = tile
    starts[m] = total
    return position if total == head[1] else np.int64(-1)


@kernel
def read_objects(words, position, starts, flags, known, who):
    """Read places in the palette (n,) of all samples; returns the position, -1 if one is not below `known`."""
    told = 0
    for t in range(flags.shape[0]):
        told += starts[t + 1] - starts[t] if flags[t] & MIXED_OBJECTS else 1
    symbols, listed = np.empty(told, np.int32), 0
    position = get_plane(symbols, MEANS[WHO], words, position)
    for i in range(told):
        listed += np.int64(symbols[i] == 2)
    indices = np.empty(listed, np.int32)
    position = get_all(indices, bits_of(known - 1), words, position)
    this, other, told, listed = np.int64(-1), np.int64(-1), 0, 0
    for t in range(flags.shape[0]):
        for i in range(starts[t], starts[t + 1]):
            if i == starts[t] or flags[t] & MIXED_OBJECTS:
                symbol = symbols[told]
                told += 1
                if symbol == 1:
                    this, other = other, this
                elif symbol == 2:
                    this, other = np.int64(indices[listed]), this
                    listed += 1
                if symbol > 2 or this < 0 or this >= known:
                    return np.int64(-1)
            who[i] = this
    return position


@kernel
def read_labels(words, position, starts, flags, times, changes):
    """Read time and change codes (n,) of all samples; returns the position, -1 if one is out of range."""
    timed = changed = 0
    for t in range(flags.shape[0]):
        count = starts[t + 1] - starts[t]
        timed += count if flags[t] & MIXED_TIMES else 1
        changed += count if flags[t] & CHANGED else 0
    told_times, told_changes = np.empty(timed, np.int32), np.empty(changed, np.int32)
    position = get_plane(told_times, MEANS[TIMES], words, position)
    position = get_plane(told_changes, MEANS[CHANGES], words, position)
    time, timed, changed = np.int64(0), 0, 0
    for t in range(flags.shape[0]):
        for i in range(starts[t], starts[t + 1]):
            if i == starts[t] or flags[t] & MIXED_TIMES:
                time += unfolded(np.int64(told_times[timed]))
                timed += 1
            changes[i] = 0
            if flags[t] & CHANGED:
                changes[i] = told_changes[changed]
                changed += 1
            if time < 0 or time > TIME_STEPS or changes[i] > CHANGE_STEPS:
                return np.int64(-1)
            times[i] = time
    return position


@kernel
def sums_of_differences(who, columns, known):
    """The inverse of differences()."""
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
            value = last[mine, c] + unfolded(np.int64(columns[c, i]))
            value = min(max(value, -(1 << 24)), 1 << 24)
            columns[c, i] = value
            last[mine, c] = value
        before = mine


@kernel
def restore_places(tiles, starts, gaps, inside, rect, pixel_on_curve, subpixels):
    """Sub-pixels (n, 2) int32 of all samples from their tiles and places on the curve; False if one is outside."""
    width, height = rect[2], rect[3]
    tile_columns = (width + TILE - 1) >> TILE_BITS
    for t in range(tiles.shape[0]):
        row, column = tiles[t] // tile_columns, tiles[t] % tile_columns
        if row & 1:
            column = tile_columns - 1 - column
        spot = np.int64(0)
        for i in range(starts[t], starts[t + 1]):
            spot += gaps[i]
            if spot > 255:
                return False
            pixel = np.int64(pixel_on_curve[spot])
            x, y = (column << TILE_BITS) | (pixel & 15), (row << TILE_BITS) | (pixel >> 4)
            if x >= width or y >= height:
                return False
            subpixels[i, 0] = (x << SUBPIXEL_BITS) | (inside[i] & 7)
            subpixels[i, 1] = (y << SUBPIXEL_BITS) | (inside[i] >> 3)
    return True


@kernel
def restore(subpixels, columns, rect, base, depth_bits, colour_of_code, samples):
    """Positions, colours and depths of samples (n,) SAMPLE, written; False if a code is out of range."""
    shift, origin = 23 - depth_bits, base << 23
    deepest = 1 + ((0x7F800000 - origin) >> shift)
    step = np.float32(1.0 / (1 << SUBPIXEL_BITS))
    for i in range(samples.shape[0]):
        x, y = np.int64(subpixels[i, 0]), np.int64(subpixels[i, 1])
        samples[i]["xy"][0] = np.float32(rect[0]) + (np.float32(x) + HALF) * step
        samples[i]["xy"][1] = np.float32(rect[1]) + (np.float32(y) + HALF) * step
        luma, orange, green = np.int64(columns[0, i]), np.int64(columns[1, i]), np.int64(columns[2, i])
        depth = np.int64(columns[3, i])
        middle = luma - (green >> 1)
        green += middle
        blue = middle - (orange >> 1)
        red = blue + orange
        if min(red, min(green, blue)) < 0 or max(red, max(green, blue)) > TOP_CODE or depth < 0 or depth > deepest:
            return False
        lift = noise_of(x, y)
        samples[i]["radiance"][0] = colour_of(red, noise(lift), colour_of_code)
        samples[i]["radiance"][1] = colour_of(green, noise(lift >> 10), colour_of_code)
        samples[i]["radiance"][2] = colour_of(blue, noise(lift >> 20), colour_of_code)
        bits = min((max(depth - 1, 0) << shift) + origin, 0x7F7FFFFF)
        samples[i]["depth"] = np.float32(np.inf) if depth == 0 else np.int32(bits).view(np.float32)
        samples[i]["lighting"] = ZERO
    return True


@kernel
def decode(words, rect, base, depth_bits, span, lit, tables, samples):
    """Read as many samples as `samples` (n,) SAMPLE has; they come in the order of their places.

    Parameters
    ----------
    words : (w + 2,) uint32, the last two of zeros
    rect : (x, y, width, height), panel pixels; base, depth_bits : of depth codes; span : float32 s, of time code 63
    lit : bool, with normals and lamps; tables : see tables.Tables

    Returns
    -------
    read : int, bits; -1 if anything is out of range
    """
    n = samples.shape[0]
    head = np.empty(2, np.int64)
    position = get_all(head, COUNT_BITS, words, np.int64(0))
    m, known = head[0], head[1]
    if m > n or known > n or (n > 0 and known == 0):
        return np.int64(-1)
    tiles, starts, flags = np.empty(m, np.int32), np.empty(m + 1, np.int64), np.empty(m, np.int32)
    all_tiles = ((rect[2] + TILE - 1) >> TILE_BITS) * ((rect[3] + TILE - 1) >> TILE_BITS)
    position = read_tiles(words, position, (all_tiles, n, LIT_FLAG_BITS if lit else FLAG_BITS), tiles, starts, flags)
    if position < 0:
        return position
    names, gaps, inside = np.empty(known, np.int32), np.empty(n, np.int32), np.empty(n, np.int32)
    position = get_plane(names, MEANS[NAMES], words, position)
    palette = summed(names, -1, 1)
    position = get_plane(gaps, MEANS[GAPS], words, position)
    position = get_all(inside, 2 * SUBPIXEL_BITS, words, position)
    who, times, changes = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int32)
    position = read_objects(words, position, starts, flags, known, who)
    if position < 0 or (known > 0 and palette[known - 1] > LARGEST_OBJECT):
        return np.int64(-1)
    position = read_labels(words, position, starts, flags, times, changes)
    if position < 0:
        return position
    columns, subpixels = np.empty((4, n), np.int32), np.empty((n, 2), np.int32)
    for c in range(4):
        position = get_plane(columns[c], MEANS[LUMA + c], words, position)
    sums_of_differences(who, columns, known)
    facing = np.zeros((3 if lit else 0, n), np.int32)
    if lit:
        position = read_facing(words, position, starts, flags, facing)
        if position < 0:
            return position
        sums_of_differences(who, facing[:2], known)
        exchange(who, facing[2], known, True)
    if not restore_places(tiles, starts, gaps, inside, rect, tables[1], subpixels):
        return np.int64(-1)
    if not restore(subpixels, columns, rect, base, depth_bits, tables[2], samples):
        return np.int64(-1)
    if not restore_facing(facing, samples):
        return np.int64(-1)
    step = np.float32(span) / np.float32(TIME_STEPS)
    for i in range(n):
        samples[i]["object_id"] = np.uint32(palette[who[i]])
        samples[i]["time"] = np.float32(times[i]) * step
        samples[i]["change"] = np.float32(changes[i]) / np.float32(CHANGE_STEPS)
    return position
