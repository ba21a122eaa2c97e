"""Stored samples to a picture: what is visible, splat, fill holes, mix in what still pixels have gathered.

Accumulators have a border of one pixel on every side, so that a sample's four neighbours always exist.
"""

from __future__ import annotations

import numpy as np

from wall.deepbuffer.kernels_reproject import OUTSIDE, pixel_of, place_of
from wall.jit import inline_kernel, kernel

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
TILE = 16  # pixels
TRUSTED = np.float32(0.25)  # weight from which a pixel needs nothing from its neighbours
BEHIND = np.float32(1.05)  # a sample deeper than its pixel's nearest by this factor is hidden
COVERS = np.float32(0.5**2)  # squared pixels: a nearer sample closer than this covers a deeper one
HIDING = 6  # of nine pixels: so many that are nearer cover what shows between them
FORGOTTEN = np.float32(0.02)  # confidence below which a sample is dropped


@kernel
def front_depths(nearest, front):
    """Each pixel's least depth over 3x3, enlarged by BEHIND: up to it a sample is seen without further tests.

    nearest, front : (h, w) float32
    """
    height, width = nearest.shape
    for i in range(height):
        up, down = max(i - 1, 0), min(i + 1, height - 1)
        for j in range(width):
            left, right = max(j - 1, 0), min(j + 1, width - 1)
            least = min(min(nearest[up, left], nearest[up, j]), min(nearest[up, right], nearest[i, left]))
            least = min(least, min(min(nearest[i, j], nearest[i, right]), min(nearest[down, left], nearest[down, j])))
            front[i, j] = min(least, nearest[down, right]) * BEHIND


@inline_kernel
def hidden(x, y, z, nearest, at):
    """Whether nearer samples cover the place of one: some lies within COVERS, or HIDING of 3x3 pixels are nearer.

    nearest : (h, w) float32; at : (h, w, 2) float32, where in the picture each pixel's nearest sample lies
    """
    i, j = int(y), int(x)
    nearer = 0
    for di in range(max(i - 1, 0), min(i + 2, nearest.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, nearest.shape[1])):
            if nearest[di, dj] * BEHIND < z:
                dx, dy = at[di, dj, 0] - x, at[di, dj, 1] - y
                if dx * dx + dy * dy < COVERS:
                    return True
                nearer += 1
    return nearer >= HIDING


@kernel
def move(place, state, screen, count, table, moved, doubt, doubt_about, stale, since, nearest, at, surface):
    """Let doubted samples lose confidence, place every sample anew, keep each pixel's nearest.

    Parameters
    ----------
    place : (capacity, 4) float32; state : (capacity, 2) float32 time, confidence; screen : (capacity, 4) float32
    table : (n + 1, 12) float32, panel_from_object; moved : (n + 1,) uint8, whose row differs from last time's
    doubt : (h, w, 2) float32, how much was contradicted and when (same clock as state); doubt_about : (h, w) int32
    nearest : (h, w) float32; surface : (h, w) int32; written

    Returns
    -------
    alive : int, samples in the picture
    """
    height, width = nearest.shape
    nearest[:] = np.inf
    surface[:] = -1
    right, bottom = np.float32(width), np.float32(height)
    alive = 0
    for k in range(count):
        x, y, z = screen[k, 0], screen[k, 1], screen[k, 2]
        name = int(place[k, 3])
        if z > ZERO:
            i, j = int(y), int(x)
            if doubt[i, j, 0] > ZERO and doubt_about[i, j] == name and state[k, 0] < doubt[i, j, 1]:
                state[k, 1] *= ONE - doubt[i, j, 0]
            if stale[i // TILE, j // TILE] > ZERO and state[k, 0] < since:
                state[k, 1] *= ONE - stale[i // TILE, j // TILE]
        if moved[name] != 0:
            x, y, z = pixel_of(place[k, 0], place[k, 1], place[k, 2], name, table)
            if not (x >= ZERO and y >= ZERO and x < right and y < bottom):
                z = OUTSIDE
            screen[k, 0], screen[k, 1] = x, y
        if state[k, 1] < FORGOTTEN:
            z = OUTSIDE
        screen[k, 2] = z
        if z > ZERO:
            alive += 1
            i, j = int(y), int(x)
            if z < nearest[i, j]:
                nearest[i, j] = z
                at[i, j, 0], at[i, j, 1] = x, y
                surface[i, j] = name
    return alive


@kernel
def splat(place, colour, state, screen, count, skip, nearest, at, front, now, young, decay, gathered, lighting):
    """Drop what is hidden or dead, add the rest to the picture, close ranks.

    A sample spreads over the four nearest pixel centres by a tent, weighed by confidence and age. Samples younger than
    `young` seconds are never hidden: what they hide may not have been seen yet.

    Parameters
    ----------
    place, colour, screen : (capacity, 4) float32; state : (capacity, 2) float32; kept samples move to the front
    skip : int, so many of the oldest are dropped beside
    nearest, at, front : see move, hidden and front_depths
    now, young : float32 seconds of the store's clock
    decay : (rows, columns) float32, 1 / seconds, how fast old samples lose weight in each tile
    gathered : (h + 2, w + 2, 4) float32, weighted radiance and weight, written
    lighting : (h + 2, w + 2) float32 weighted square root of lighting, written; | None

    Returns
    -------
    kept : int
    """
    gathered[:] = ZERO
    if lighting is not None:
        lighting[:] = ZERO
    kept = 0
    for k in range(count):
        z = screen[k, 2]
        if not z > ZERO:
            continue
        if skip > 0:
            skip -= 1
            continue
        x, y = screen[k, 0], screen[k, 1]
        i, j = int(y), int(x)
        age = now - state[k, 0]
        if z > front[i, j] and age > young and hidden(x, y, z, nearest, at):
            continue
        a = max(age, ZERO) * decay[i // TILE, j // TILE]
        weight = state[k, 1] / (ONE + a * (ONE + a * (HALF + a * np.float32(1.0 / 6.0))))
        red, green, blue, light = colour[k, 0], colour[k, 1], colour[k, 2], colour[k, 3]
        u, v = x + HALF, y + HALF  # border included
        m, n = int(v), int(u)
        fu, fv = u - np.float32(n), v - np.float32(m)
        w11 = fu * fv * weight
        w10 = fv * weight - w11
        w01 = fu * weight - w11
        w00 = weight - w01 - w10 - w11
        add(gathered, m, n, red, green, blue, w00)
        add(gathered, m, n + 1, red, green, blue, w01)
        add(gathered, m + 1, n, red, green, blue, w10)
        add(gathered, m + 1, n + 1, red, green, blue, w11)
        if lighting is not None:
            lighting[m, n] += w00 * light
            lighting[m, n + 1] += w01 * light
            lighting[m + 1, n] += w10 * light
            lighting[m + 1, n + 1] += w11 * light
        if kept != k:
            for c in range(4):
                place[kept, c] = place[k, c]
                colour[kept, c] = colour[k, c]
            screen[kept, 0], screen[kept, 1], screen[kept, 2] = x, y, z
            state[kept, 0], state[kept, 1] = state[k, 0], state[k, 1]
        kept += 1
    return kept


@inline_kernel
def add(gathered, i, j, red, green, blue, weight):
    gathered[i, j, 0] += weight * red
    gathered[i, j, 1] += weight * green
    gathered[i, j, 2] += weight * blue
    gathered[i, j, 3] += weight


@kernel
def halve(fine, border, trusted, coarse):
    """One level of a pyramid: sums over 2x2, a pixel of weight `trusted` or more counting once.

    fine : (h, w, 4) float32 weighted radiance and weight, with `border` pixels around
    coarse : (ceil(h/2), ceil(w/2), 4) float32, written
    """
    height, width = fine.shape[0] - 2 * border, fine.shape[1] - 2 * border
    coarse[:] = ZERO
    for i in range(height):
        for j in range(width):
            weight = fine[i + border, j + border, 3]
            scale = ONE / max(weight, trusted)
            for c in range(4):
                coarse[i >> 1, j >> 1, c] += scale * fine[i + border, j + border, c]


@kernel
def expand(coarse, filled):
    """Divide by weight, and where that is below 1 mix in the coarser level (bilinear).

    coarse : (h, w, 4) float32 sums of halve(); on return, rows 0..2 hold radiance.
    filled : (h', w', 4) float32, the coarser level after its own expand(), | None at the top
    """
    for i in range(coarse.shape[0]):
        for j in range(coarse.shape[1]):
            weight = coarse[i, j, 3]
            scale = ONE / max(weight, ONE)
            red, green, blue = coarse[i, j, 0] * scale, coarse[i, j, 1] * scale, coarse[i, j, 2] * scale
            if weight < ONE:
                if filled is not None:
                    r, g, b = between(filled, i, j)
                    red += (ONE - weight) * r
                    green += (ONE - weight) * g
                    blue += (ONE - weight) * b
                elif weight > ZERO:
                    red, green, blue = red / weight, green / weight, blue / weight
            coarse[i, j, 0], coarse[i, j, 1], coarse[i, j, 2] = red, green, blue


@inline_kernel
def between(filled, i, j):
    """The coarser level at the centre of pixel (i, j): bilinear, weights 9 3 3 1 of 16."""
    m, n = i >> 1, j >> 1
    mm = min(max(m - 1 + 2 * (i & 1), 0), filled.shape[0] - 1)
    nn = min(max(n - 1 + 2 * (j & 1), 0), filled.shape[1] - 1)
    a, b, c, d = np.float32(9.0 / 16.0), np.float32(3.0 / 16.0), np.float32(3.0 / 16.0), np.float32(1.0 / 16.0)
    red = a * filled[m, n, 0] + b * filled[m, nn, 0] + c * filled[mm, n, 0] + d * filled[mm, nn, 0]
    green = a * filled[m, n, 1] + b * filled[m, nn, 1] + c * filled[mm, n, 1] + d * filled[mm, nn, 1]
    blue = a * filled[m, n, 2] + b * filled[m, nn, 2] + c * filled[mm, n, 2] + d * filled[mm, nn, 2]
    return red, green, blue


@kernel
def resolve(gathered, filled, shown):
    """The picture: weighted means, and where the weight is below TRUSTED the filled coarser level.

    gathered : (h + 2, w + 2, 4) float32; filled : (ceil(h/2), ceil(w/2), 4) float32; shown : (h, w, 3) float32, written
    """
    height, width = shown.shape[0], shown.shape[1]
    for i in range(height):
        for j in range(width):
            weight = gathered[i + 1, j + 1, 3]
            scale = ONE / max(weight, TRUSTED)
            red, green, blue = (
                gathered[i + 1, j + 1, 0] * scale,
                gathered[i + 1, j + 1, 1] * scale,
                gathered[i + 1, j + 1, 2] * scale,
            )
            if weight < TRUSTED:
                r, g, b = between(filled, i, j)
                missing = ONE - weight / TRUSTED
                red += missing * r
                green += missing * g
                blue += missing * b
            shown[i, j, 0], shown[i, j, 1], shown[i, j, 2] = red, green, blue


@kernel
def doubt_still(still, surface, moved, doubt):
    """What pixels gathered while they stood still: gone where what they show moves, less where it was contradicted.

    still : (h, w, 8) float32: radiance sums (3), count, mean and squared deviations of sqrt luminance, 0, 0; updated
    surface : (h, w) int32; moved : (n + 1,) uint8; doubt : (h, w, 2) float32, cleared
    """
    for i in range(surface.shape[0]):
        for j in range(surface.shape[1]):
            name = surface[i, j]
            if name < 0 or moved[name] != 0:
                still[i, j, :] = ZERO
            elif doubt[i, j, 0] > ZERO:
                keep = (ONE - doubt[i, j, 0]) ** 3  # one doubt must outweigh many samples that agreed
                for c in range(4):
                    still[i, j, c] *= keep
                still[i, j, 5] *= keep
                still[i, j, 7] *= keep
            doubt[i, j, 0] = ZERO


@kernel
def mix_still(base, still, dirty, shown):
    """Where pixels stand still, their own mean takes over from the reconstruction as 1 - 1 / (1 + n)^2.

    base : (h, w, 3) float32; still : (h, w, 8) float32; dirty : (rows, columns) bool, tiles to redo
    shown : (h, w, 3) float32, written
    """
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            for i in range(row * TILE, min((row + 1) * TILE, base.shape[0])):
                for j in range(column * TILE, min((column + 1) * TILE, base.shape[1])):
                    n = still[i, j, 3]
                    part = ONE / ((ONE + n) * (ONE + n))
                    own = (ONE - part) / max(n, np.float32(1e-6))
                    for c in range(3):
                        shown[i, j, c] = part * base[i, j, c] + own * still[i, j, c]


@kernel
def take_in(
    samples, offset, frame, corner, object_from_eye, table, place, colour, state, screen, count, surface, gathered,
    lighting, doubt, doubt_about, residual, probes, still, steady, still_mode, judging, dirty
):  # fmt: skip
    """Store a batch, and see how each sample agrees with the picture beneath it.

    Parameters
    ----------
    samples : (n,) SAMPLE; its `change` is written if judging
    offset : float32, seconds from the store's clock zero to the batch's base time
    frame, corner, object_from_eye : of the event they were traced under, see object_tables
    table : panel_from_object of the picture
    place, colour, state, screen : the store, written from `count` on
    surface, gathered, lighting : of the picture
    doubt, doubt_about : (h, w, 2) float32, (h, w) int32; raised where a sample contradicts
    residual : (rows, columns) float32, moving mean of |change of lighting| in each tile, updated if judging
    probes : (rows, columns, 2) float32, samples judged in each tile and their change, added to
    still : (h, w, 8) float32, updated; steady : bool, these samples show what the picture shows
    still_mode : bool, nothing moves: changes are noise, count is all
    dirty : (rows, columns) bool, set where the picture changes

    Returns
    -------
    count : int, stored now
    """
    height, width = surface.shape
    for k in range(samples.shape[0]):
        if count >= place.shape[0]:
            break
        sample = samples[k]
        name = int(sample["object"])
        if name >= object_from_eye.shape[0]:
            continue
        x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
        a, b, c = place_of(x, y, sample["depth"], name, frame, object_from_eye)
        place[count, 0], place[count, 1], place[count, 2], place[count, 3] = a, b, c, np.float32(name)
        red, green, blue = sample["radiance"][0], sample["radiance"][1], sample["radiance"][2]
        light = sample["light"]
        colour[count, 0], colour[count, 1], colour[count, 2], colour[count, 3] = red, green, blue, light
        time = offset + sample["time"]
        state[count, 0], state[count, 1] = time, ONE
        u, v, z = pixel_of(a, b, c, name, table)
        if not (u >= ZERO and v >= ZERO and u < width and v < height):
            z = OUTSIDE
        screen[count, 0], screen[count, 1], screen[count, 2] = u, v, z
        count += 1
        if not z > ZERO:
            continue
        i, j = int(v), int(u)
        dirty[i // TILE, j // TILE] = True
        if not still_mode:
            change = sample["change"]
            if judging:
                change = ZERO
                if surface[i, j] == name and gathered[i + 1, j + 1, 3] > TRUSTED:
                    was = lighting[i + 1, j + 1] / gathered[i + 1, j + 1, 3]
                    if still[i, j, 3] >= KNOWN:
                        was = still[i, j, 6]
                    difference = abs(light - was)
                    if difference > SMALL_CHANGE:
                        if still[i, j, 3] >= KNOWN:
                            noise = SIGMAS * np.sqrt(still[i, j, 7] / still[i, j, 3])
                        else:
                            noise = NOISE * spread_of(lighting, gathered, surface, i, j, name)
                        difference = max(difference - noise, ZERO)
                    change = min(max((difference - SMALL_CHANGE) * PER_CHANGE, ZERO), ONE)
                    tile = residual[i // TILE, j // TILE]
                    residual[i // TILE, j // TILE] = tile + RESIDUAL_SHARE * (difference - tile)
                sample["change"] = change
            probes[i // TILE, j // TILE, 0] += ONE
            probes[i // TILE, j // TILE, 1] += change
            if change > ZERO:
                spread_doubt(doubt, doubt_about, i, j, change, time, name)
        if steady:
            gather_still(still, i, j, red, green, blue, light)
    return count


SMALL_CHANGE = np.float32(0.018)  # of the square root of lighting: below it, sampling noise
PER_CHANGE = np.float32(1.0 / 0.06)
NOISE = np.float32(0.5)  # share of the lighting's range over 3x3 pixels that counts as noise
KNOWN = np.float32(3.0)  # samples of a still pixel from which its own deviation says what is noise:
SIGMAS = np.float32(2.0)  # so many standard deviations
RESIDUAL_SHARE = np.float32(1.0 / 16.0)


@inline_kernel
def spread_of(lighting, gathered, surface, i, j, name):
    """The range of the lighting over the 3x3 pixels around that show the same object."""
    low, high = np.float32(np.inf), np.float32(-np.inf)
    for di in range(max(i - 1, 0), min(i + 2, surface.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, surface.shape[1])):
            weight = gathered[di + 1, dj + 1, 3]
            if surface[di, dj] == name and weight > TRUSTED:
                light = lighting[di + 1, dj + 1] / weight
                low, high = min(low, light), max(high, light)
    return max(high - low, ZERO)


@inline_kernel
def gather_still(still, i, j, red, green, blue, light):
    """Welford's update of what a still pixel gathered."""
    pixel = still[i, j]
    pixel[0] += red
    pixel[1] += green
    pixel[2] += blue
    pixel[3] += ONE
    value = np.sqrt(max(np.float32(0.2126) * red + np.float32(0.7152) * green + np.float32(0.0722) * blue, ZERO))
    delta = value - pixel[4]
    pixel[4] += delta / pixel[3]
    pixel[5] += delta * (value - pixel[4])
    delta = light - pixel[6]
    pixel[6] += delta / pixel[3]
    pixel[7] += delta * (light - pixel[6])


@inline_kernel
def spread_doubt(doubt, doubt_about, i, j, change, time, name):
    """Doubt the 3x3 pixels around a contradicted one, the less the farther they are."""
    for di in range(max(i - 1, 0), min(i + 2, doubt.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, doubt.shape[1])):
            square = (di - i) * (di - i) + (dj - j) * (dj - j)
            amount = change / (ONE + HALF * np.float32(square))
            if amount > doubt[di, dj, 0]:
                doubt[di, dj, 0] = amount
                doubt[di, dj, 1] = time
                doubt_about[di, dj] = name
