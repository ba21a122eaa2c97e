"""Tell changed light from noise, tile by tile, and bring older samples to what new ones find.

A new sample says little alone. The differences of many, to the filtered light of their pixels, have a mean and a
standard error: what is beyond that is change. Older samples are multiplied by it, and doubted where even that change is
larger than what the filter does not know anyway. What moves says nothing about what stands beside it, nor the sky about
either: each tile knows the changes of still and of animated objects apart.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.accumulation import luminance
from wall.deepbuffer.kernels.columns import DEPTH, X, Y
from wall.reconstruction.kernels.edge_filter import tap_share
from wall.reconstruction.kernels.light_field import L_COUNT, VARIANCE, find_surface

uint32 = np.uint32
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
LIGHT_TILE = 8  # pixels, edge
# columns of `probes`: sums of differences, of filtered light, of probes, of their variance, of the filter's variance
DIFFERENCE, FILTERED, PROBES, PROBE_VARIANCE, FILTER_VARIANCE, COLUMNS = 0, 3, 6, 7, 8, 9
CLIP = np.float32(4.0)  # standard deviations that a probe's luminance differs at most
REMEMBERED = np.float32(0.7)  # share of the probes' weight that is left a refresh later,
CORRECTED = np.float32(0.2)  # and after older samples were corrected by them
CERTAIN = np.float32(2.0)  # times the squared standard error: what a squared mean has to exceed to count as change
LEAST, MOST = np.float32(0.5), np.float32(2.0)  # factors of a correction
WHOLE_S = np.float32(0.055)  # age from which a sample is corrected whole
LEAST_KEPT = np.float32(0.3)  # confidence that is left where change is far beyond the filter's error
TINY = np.float32(1e-20)


@kernel
def probe_light(store, first, last, table, rows, field, moves, probes):
    """Compare samples first..last of the store with the filtered light of their pixels.

    store : SampleStore; field : LightField, as filtered last; table, rows : see show_light
    moves : (n + 1,) uint8, whether an object is animated
    probes : (2, rows, columns, COLUMNS) float32, of still and of animated objects, updated
    """
    screen, filtered = store.screen_position, field.filtered
    for k in range(first, last):
        if not screen[DEPTH, k] > ZERO:
            continue
        found, i, j = find_surface(store, k, table, rows, field.pixels)
        count = filtered[L_COUNT, i, j]
        if not found or not count > ZERO or store.object_id[k] == 0:
            continue
        a, b, c = filtered[0, i, j], filtered[1, i, j], filtered[2, i, j]
        x, y, z = store.light[k, 0] - a, store.light[k, 1] - b, store.light[k, 2] - c
        variance = field.pixels[VARIANCE, i, j]
        own, limit = abs(luminance(x, y, z)), CLIP * math.sqrt(variance)
        share = limit / own if own > limit else ONE
        row, column = uint32(screen[Y, k]) // uint32(LIGHT_TILE), uint32(screen[X, k]) // uint32(LIGHT_TILE)
        tile = probes[moves[store.object_id[k]], row, column]
        tile[DIFFERENCE] += share * x
        tile[DIFFERENCE + 1] += share * y
        tile[DIFFERENCE + 2] += share * z
        tile[FILTERED] += a
        tile[FILTERED + 1] += b
        tile[FILTERED + 2] += c
        tile[PROBES] += ONE
        tile[PROBE_VARIANCE] += variance
        tile[FILTER_VARIANCE] += variance / count


@kernel
def find_changes(probes, changes):
    """Write the factors of each tile's light, and the share of confidence that older samples keep.

    probes : (rows, columns, COLUMNS) float32, those that led to a correction count less from now on, all decay
    changes : (rows, columns, 4) float32, written

    Returns
    -------
    any : bool, whether some tile has changed
    """
    rows, columns = probes.shape[0], probes.shape[1]
    sums = np.empty(COLUMNS, np.float32)
    found = False
    for i in range(rows):
        for j in range(columns):
            sums[:] = ZERO
            for y in range(max(i - 1, 0), min(i + 2, rows)):
                for x in range(max(j - 1, 0), min(j + 2, columns)):
                    share = tap_share(y - i, x - j)
                    for c in range(COLUMNS):
                        sums[c] += share * probes[y, x, c]
            changes[i, j] = ONE
            n = sums[PROBES]
            if not n > ONE:
                continue
            mean = luminance(sums[DIFFERENCE], sums[DIFFERENCE + 1], sums[DIFFERENCE + 2]) / n
            error = sums[PROBE_VARIANCE] / (n * n)
            beyond = mean * mean - CERTAIN * error
            if not beyond > ZERO:
                continue
            found = True
            trust = beyond / (beyond + error)
            for c in range(3):
                factor = ONE + trust * sums[DIFFERENCE + c] / max(sums[FILTERED + c], TINY)
                changes[i, j, c] = min(max(factor, LEAST), MOST)
            known = sums[FILTER_VARIANCE] / n
            if beyond > known:
                changes[i, j, 3] = math.sqrt(max(math.sqrt(known / beyond), LEAST_KEPT))
    for i in range(rows):
        for j in range(columns):
            corrected = (changes[i, j, 0] != ONE) | (changes[i, j, 1] != ONE) | (changes[i, j, 2] != ONE)
            share = CORRECTED if corrected else REMEMBERED
            probes[i, j] *= share
            probes[i, j, PROBE_VARIANCE] *= share
    return found


@kernel
def correct_light(store, count, changes, moves, now):
    """Bring the light of older samples to what new ones found, and take confidence from them.

    store : SampleStore, `light` and `confidence` updated; count : int, samples stored
    changes : (2, rows, columns, 4) float32, see find_changes, of still and of animated objects
    moves : (n + 1,) uint8, whether an object is animated; now : float32 seconds of the store's clock
    """
    screen = store.screen_position
    rows, columns = changes.shape[1], changes.shape[2]
    for k in range(count):
        if not screen[DEPTH, k] > ZERO or store.object_id[k] == 0:
            continue
        v = min(max(screen[Y, k] / np.float32(LIGHT_TILE) - HALF, ZERO), np.float32(rows - 1))
        u = min(max(screen[X, k] / np.float32(LIGHT_TILE) - HALF, ZERO), np.float32(columns - 1))
        i, j = int(v), int(u)
        a, b = min(i + 1, rows - 1), min(j + 1, columns - 1)
        fv, fu = v - np.float32(i), u - np.float32(j)
        own = changes[moves[store.object_id[k]]]
        phi = min(max(now - store.time[k], ZERO) / WHOLE_S, ONE)
        for c in range(4):
            factor = mix(mix(own[i, j, c], own[i, b, c], fu), mix(own[a, j, c], own[a, b, c], fu), fv)
            part = ONE + phi * (factor - ONE)
            if c < 3:
                store.light[k, c] *= part
            else:
                store.confidence[k] *= part


@inline_kernel
def mix(a, b, share):
    """Linear interpolation."""
    return a + share * (b - a)
