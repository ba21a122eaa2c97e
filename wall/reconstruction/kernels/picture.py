"""Stored samples to a picture: take in, place, splat, mix in what still pixels have gathered.

Accumulators have a border of one pixel on every side, so that a sample's four neighbours always exist.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import FAR, NEAREST, OUTSIDE, pixel_of, place_of
from wall.reconstruction.kernels.fill import TRUSTED
from wall.reconstruction.kernels.relight import NOT_RELIT, remember_colour, surface_of

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
FORGOTTEN = np.float32(0.02)  # confidence below which a sample is dropped


@kernel
def lose_confidence(name, state, screen, count, doubted, doubt, doubt_about, stale, since):
    """Let samples lose confidence: those beneath a contradiction, and those of tiles that have changed as a whole.

    Parameters
    ----------
    name : (capacity,) int32, object ids; state : (2, capacity) float32, time and confidence, the latter updated
    screen : (3, capacity) float32, x, y, depth in the picture that was doubted
    doubted : (rows, columns) bool, tiles in which there is anything to lose
    doubt : (h, w, 2) float32, how much was contradicted and when; doubt_about : (h, w) int32, whose surface
    count : int, samples stored; since : float32 seconds of the store's clock
    stale : (rows, columns) float32, share of confidence that each tile's samples from before `since` lose
    """
    for k in range(count):
        if not screen[2, k] > ZERO:
            continue
        i, j = uint32(screen[1, k]), uint32(screen[0, k])
        if not doubted[i // TILE, j // TILE]:
            continue
        time, confidence = state[0, k], state[1, k]
        if doubt[i, j, 0] > ZERO and doubt_about[i, j] == name[k] and time < doubt[i, j, 1]:
            confidence *= ONE - doubt[i, j, 0]
        if time < since:
            confidence *= ONE - stale[i // TILE, j // TILE]
        state[1, k] = confidence if confidence >= FORGOTTEN else ZERO


@kernel
def place_samples(place, name, count, table, moved, right, bottom, screen):
    """Place every sample whose object moved on the screen, as many in a row as there are.

    place : (3, capacity) float32, object-local; name : (capacity,) int32; table : (n + 1, 12) float32
    moved : (n + 1,) uint8, whose row of the table differs from last time's; right, bottom : float32, picture pixels
    screen : (3, capacity) float32, written: x, y, depth (OUTSIDE where it is not in the picture)
    """
    rows = table.reshape(-1)
    first = 0
    while first < count:
        last = first
        while last < count and moved[name[last]] != 0:
            last += 1
        place_run(place, name, first, last, rows, right, bottom, screen)
        first = last + 1


@inline_kernel
def place_run(place, name, first, last, rows, right, bottom, screen):
    """Samples first..last-1: nothing but arithmetic, so that it becomes vector code."""
    for k in range(first, last):
        a, b, c = place[0, k], place[1, k], place[2, k]
        m = uint32(name[k]) * uint32(12)
        w = rows[m] * a + rows[m + uint32(1)] * b + rows[m + uint32(2)] * c + rows[m + uint32(3)]
        x = rows[m + uint32(4)] * a + rows[m + uint32(5)] * b + rows[m + uint32(6)] * c + rows[m + uint32(7)]
        y = rows[m + uint32(8)] * a + rows[m + uint32(9)] * b + rows[m + uint32(10)] * c + rows[m + uint32(11)]
        inverse = ONE / w
        x *= inverse
        y *= inverse
        inside = (w > NEAREST) & (x >= ZERO) & (y >= ZERO) & (x < right) & (y < bottom)
        z = FAR if name[k] == 0 else w
        screen[0, k] = x
        screen[1, k] = y
        screen[2, k] = z if inside else OUTSIDE


@kernel
def splat(colour, screen, weight, count, sharpness, gathered, lighting):
    """Add samples to the picture: a sample spreads over the four nearest pixel centres by a tent, or a steeper one.

    Between two centres its share goes from one to the other within 1 / sharpness pixels, about the edge between them:
    shares still sum to 1. At sharpness 1 that is a tent, far above it the box of which the ideal picture is the mean.

    Parameters
    ----------
    colour : (capacity, 4) float32, radiance and square root of lighting
    screen : (3, capacity) float32; weight : (capacity,) float32, see weigh
    sharpness : (h, w) float32, 1 or more, see front_bounds
    gathered : (h + 2, w + 2, 4) float32, weighted radiance and weight, written
    lighting : (h, w, 2) float32, weighted square root of lighting and weight, each sample in its own pixel, written;
        | None
    """
    flat, row = gathered.reshape(-1), uint32(4 * gathered.shape[1])
    flat[:] = ZERO
    if lighting is not None:
        lighting[:] = ZERO
    for k in range(count):
        w = weight[k]
        if not w > ZERO:
            continue
        x, y = screen[0, k], screen[1, k]
        i, j = uint32(y), uint32(x)
        sharp = sharpness[i, j]
        if lighting is not None:
            lighting[i, j, 0] += w * colour[k, 3]
            lighting[i, j, 1] += w
        x += HALF  # border included
        y += HALF
        i, j = uint32(y), uint32(x)
        fx = min(max((x - np.float32(j) - HALF) * sharp + HALF, ZERO), ONE)
        fy = min(max((y - np.float32(i) - HALF) * sharp + HALF, ZERO), ONE)
        red, green, blue = colour[k, 0], colour[k, 1], colour[k, 2]
        w11 = fx * fy * w
        w10 = fy * w - w11
        w01 = fx * w - w11
        i = i * row + j * uint32(4)
        add(flat, i, red, green, blue, w - w01 - w10 - w11)
        add(flat, i + uint32(4), red, green, blue, w01)
        add(flat, i + row, red, green, blue, w10)
        add(flat, i + row + uint32(4), red, green, blue, w11)


@inline_kernel
def add(flat, i, red, green, blue, weight):
    """Four numbers in a row and nothing between: one vector instruction each."""
    flat[i] += weight * red
    flat[i + uint32(1)] += weight * green
    flat[i + uint32(2)] += weight * blue
    flat[i + uint32(3)] += weight


@kernel
def doubt_still(still, nearest, moved, doubt):
    """What pixels gathered while they stood still: gone where what they show moves, less where it was contradicted.

    still : (h, w, 8) float32: radiance sums (3), count, mean and squared deviations of
        sqrt luminance, the same of sqrt lighting; updated
    nearest : (h, w, 4) float32, see keep_nearest; moved : (n + 1,) uint8; doubt : (h, w, 2) float32, cleared
    """
    for i in range(nearest.shape[0]):
        for j in range(nearest.shape[1]):
            if still[i, j, 3] > ZERO:
                name = int(nearest[i, j, 3])
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
                    n, part, own = still[i, j, 3], ONE, ZERO
                    if n > ZERO:
                        part = ONE / ((ONE + n) * (ONE + n))
                        own = (ONE - part) / n
                    for c in range(3):
                        shown[i, j, c] = part * base[i, j, c] + own * still[i, j, c]


@kernel
def take_in(
    samples, offset, frame, corner, object_from_eye, table, place, name, colour, state, screen, surface, albedo, count,
    nearest, lighting, doubt, doubt_about, residual, probes, still, steady, still_mode, stored, judging, dirty,
    lamps, suns, up, matt, irradiance,
):  # fmt: skip
    """Store a batch, and see how each sample agrees with the picture beneath it.

    Parameters
    ----------
    samples : (n,) SAMPLE; its `change` is written if judging
    offset : float32, seconds from the store's clock zero to the batch's base time
    frame, corner, object_from_eye : of the event they were traced under, see object_tables
    table : panel_from_object of the picture
    place, name, colour, state, screen, surface, albedo : the store, written from `count` on
    nearest, lighting : of the picture; doubt, doubt_about : (h, w, 2) float32, (h, w) int32, raised by contradictions
    residual : (rows, columns) float32, moving mean of |change of lighting| in each tile, updated if judging
    probes : (rows, columns, 2) float32, samples judged in each tile and their change, added to
    still : (h, w, 8) float32, updated; steady : bool, these samples show what the picture shows
    still_mode : bool, changes are noise; stored : float32, a steady pixel that gathered so many stores no more
    dirty : (rows, columns) bool, set where the picture changes
    lamps, suns, up, irradiance : see kernels_relight.lighting; matt : (n + 1,) uint8, who can be relit

    Returns
    -------
    count : int, stored now
    """
    rows = np.empty((8, CHUNK), np.float32)
    for first in range(0, samples.shape[0], CHUNK):
        last = min(first + CHUNK, samples.shape[0])
        find_places(samples, first, last, frame, corner, object_from_eye, table, nearest.shape, rows)
        if judging and not still_mode:
            look_beneath(samples, first, last, nearest, lighting, still, rows)
        for k in range(first, last):
            if count >= name.shape[0]:
                return count
            sample, r = samples[k], k - first
            thing, u, v, z = int(sample["object_id"]), rows[3, r], rows[4, r], rows[5, r]
            if z == NOWHERE:
                continue
            shown = z > ZERO
            i, j = (int(v), int(u)) if shown else (0, 0)
            time = offset + sample["time"]
            if not (shown and steady and still[i, j, 3] >= stored):  # such a pixel's mean gains; stored, it would drive
                a, b, c = rows[0, r], rows[1, r], rows[2, r]  # plain surfaces' few samples out
                place[0, count], place[1, count], place[2, count] = a, b, c
                name[count] = thing
                for n in range(3):
                    colour[count, n] = sample["radiance"][n]
                colour[count, 3] = sample["lighting"]
                if albedo.shape[1] > 0:
                    surface[count] = surface_of(sample)
                    albedo[0, count] = NOT_RELIT
                    if matt[thing] != 0:
                        remember_colour(
                            sample, a, b, c, lamps[thing], suns, up[thing], irradiance, surface, albedo, count
                        )
                state[0, count], state[1, count] = time, ONE
                screen[0, count], screen[1, count], screen[2, count] = u, v, z
                count += 1
            if not shown:
                continue
            dirty[i // TILE, j // TILE] = True
            if not still_mode:
                change = sample["change"]
                if judging:
                    change = judged(
                        sample["lighting"], rows[6, r], rows[7, r], i, j, thing, nearest, lighting, still, residual
                    )
                    sample["change"] = change
                probes[i // TILE, j // TILE, 0] += ONE
                probes[i // TILE, j // TILE, 1] += change
                if change > ZERO:
                    spread_doubt(doubt, doubt_about, i, j, change, time, thing)
            if steady:
                gather_still(still, i, j, sample)
    return count


CHUNK = 64  # samples: first everything beneath them is fetched, which memory does for many at a time
NOWHERE = np.float32(-2.0)  # depth of a sample whose object does not exist


@inline_kernel
def find_places(samples, first, last, frame, corner, object_from_eye, table, shape, rows):
    """Rows 0 to 5 of (8, CHUNK): place in the object; x, y, depth in the picture, OUTSIDE or NOWHERE."""
    bottom, right = np.float32(shape[0]), np.float32(shape[1])
    for k in range(first, last):
        sample, r = samples[k], k - first
        thing = int(sample["object_id"])
        if thing >= object_from_eye.shape[0]:
            rows[5, r] = NOWHERE
            continue
        x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
        a, b, c = place_of(x, y, sample["depth"], thing, frame, object_from_eye)
        rows[0, r], rows[1, r], rows[2, r] = a, b, c
        u, v, z = pixel_of(a, b, c, thing, table)
        rows[3, r], rows[4, r] = u, v
        rows[5, r] = z if u >= ZERO and v >= ZERO and u < right and v < bottom else OUTSIDE


@inline_kernel
def look_beneath(samples, first, last, nearest, lighting, still, rows):
    """Rows 6 and 7: the lighting shown where a sample falls (-1: of another object), its still pixel's count."""
    for k in range(first, last):
        r = k - first
        rows[6, r] = -ONE
        if rows[5, r] > ZERO:
            i, j = int(rows[4, r]), int(rows[3, r])
            sum, weight = lighting[i, j, 0], lighting[i, j, 1]
            known = (nearest[i, j, 3] == samples[k]["object_id"]) & (weight > TRUSTED)
            rows[6, r] = sum / weight if known else -ONE
            rows[7, r] = still[i, j, 3]


@inline_kernel
def judged(light, was, count, i, j, thing, nearest, lighting, still, residual):
    """How much a sample contradicts what is shown, 0..1: beyond what sampling alone brings about."""
    if was < ZERO:
        return ZERO
    known = count >= KNOWN
    was = still[i, j, 6] if known else was
    difference = abs(light - was)
    if difference > SMALL_CHANGE:
        if known:
            noise = SIGMAS * np.sqrt(still[i, j, 7] / still[i, j, 3])
        else:
            noise = NOISE * spread_of(lighting, nearest, i, j, thing)
        difference = max(difference - noise, ZERO)
    tile = residual[i // TILE, j // TILE]
    residual[i // TILE, j // TILE] = tile + RESIDUAL_SHARE * (difference - tile)
    return min(max((difference - SMALL_CHANGE) * PER_CHANGE, ZERO), ONE)


SMALL_CHANGE = np.float32(0.018)  # of the square root of lighting: below it, sampling noise
PER_CHANGE = np.float32(1.0 / 0.06)
NOISE = np.float32(0.5)  # share of the lighting's range over 3x3 pixels that counts as noise
KNOWN = np.float32(3.0)  # samples of a still pixel from which its own deviation says what is noise:
SIGMAS = np.float32(2.0)  # so many standard deviations
RESIDUAL_SHARE = np.float32(1.0 / 16.0)


@inline_kernel
def spread_of(lighting, nearest, i, j, thing):
    """The range of the lighting over the 3x3 pixels around that show the same object."""
    low, high = np.float32(np.inf), np.float32(-np.inf)
    for di in range(max(i - 1, 0), min(i + 2, nearest.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, nearest.shape[1])):
            weight = lighting[di, dj, 1]
            if nearest[di, dj, 3] == thing and weight > TRUSTED:
                light = lighting[di, dj, 0] / weight
                low, high = min(low, light), max(high, light)
    return max(high - low, ZERO)


@inline_kernel
def gather_still(still, i, j, sample):
    """Welford's update of what a still pixel gathered."""
    pixel = still[i, j]
    red, green, blue = sample["radiance"][0], sample["radiance"][1], sample["radiance"][2]
    pixel[0] += red
    pixel[1] += green
    pixel[2] += blue
    pixel[3] += ONE
    value = np.sqrt(max(np.float32(0.2126) * red + np.float32(0.7152) * green + np.float32(0.0722) * blue, ZERO))
    delta = value - pixel[4]
    pixel[4] += delta / pixel[3]
    pixel[5] += delta * (value - pixel[4])
    delta = sample["lighting"] - pixel[6]
    pixel[6] += delta / pixel[3]
    pixel[7] += delta * (sample["lighting"] - pixel[6])


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
