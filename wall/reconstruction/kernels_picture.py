"""Stored samples to a picture: what is visible, splat, mix in what still pixels have gathered.

Accumulators have a border of one pixel on every side, so that a sample's four neighbours always exist.
"""

from __future__ import annotations

import numpy as np

from wall.deepbuffer.kernels import TILE
from wall.deepbuffer.kernels_reproject import FAR, NEAREST, OUTSIDE, pixel_of, place_of
from wall.jit import inline_kernel, kernel
from wall.reconstruction.kernels_fill import TRUSTED
from wall.reconstruction.kernels_relight import NOT_RELIT, remember_colour, surface_of

INFINITE = np.float32(np.inf)
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
BEHIND = np.float32(1.05)  # a sample deeper than its pixel's nearest by this factor is hidden
COVERS = np.float32(0.5**2)  # squared pixels: a nearer sample closer than this covers a deeper one,
AMIDST, ALONE = np.float32(0.75), np.float32(0.3)  # and so do n whose mean lies closer than AMIDST + ALONE / n pixels
SLOT = np.float32(6.0)  # of nine pixels: with fewer nearer ones, a pixel that shows the deeper surface itself is a gap
WAITS = np.float32(0.5)  # seconds: so young a hidden sample is kept, for it may come out again
RIM = np.float32(8.0)  # 1 / s: how much faster samples lose weight at silhouettes, where coverage changes
FORGOTTEN = np.float32(0.02)  # confidence below which a sample is dropped


@kernel
def front_depths(nearest, front):
    """Each pixel's least and greatest depth over 3x3, enlarged by BEHIND.

    Up to the one a sample is seen, beyond the other it is hidden, without further tests.

    nearest : (h, w, 4) float32, see keep_nearest
    front : (h, w, 3) float32, written: both, and RIM where deeper surfaces show within the 3x3 pixels, else 0
    """
    height, width = front.shape[0], front.shape[1]
    for i in range(height):
        for j in range(width):
            least, most, all_of_them = INFINITE, ZERO, ZERO
            for di in range(max(i - 1, 0), min(i + 2, height)):
                for dj in range(max(j - 1, 0), min(j + 2, width)):
                    depth = nearest[di, dj, 0]
                    least = min(least, depth)
                    most = max(most, depth if depth < INFINITE else ZERO)
                    all_of_them = max(all_of_them, depth)
            front[i, j, 0] = least * BEHIND
            front[i, j, 1] = all_of_them * BEHIND
            front[i, j, 2] = RIM if most > least * BEHIND else ZERO


@inline_kernel
def hidden(x, y, z, nearest):
    """Whether nearer samples cover the place of one: some lies within COVERS, or it lies amidst those of 3x3 pixels.

    Where all nine are nearer it need not be called: front_depths knows.

    Beside a silhouette all nearer samples lie on one side, so that their mean is far: counting them alone would let
    silhouettes grow by half a pixel.

    nearest : (h, w, 4) float32, see keep_nearest
    """
    i, j = int(y), int(x)
    count, right, down = ZERO, ZERO, ZERO
    for di in range(max(i - 1, 0), min(i + 2, nearest.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, nearest.shape[1])):
            if nearest[di, dj, 0] * BEHIND < z:
                dx, dy = nearest[di, dj, 1] - x, nearest[di, dj, 2] - y
                if dx * dx + dy * dy < COVERS:
                    return True
                count += ONE
                right += dx
                down += dy
    if count < SLOT and nearest[i, j, 0] * BEHIND >= z:
        return False
    reach = AMIDST * count + ALONE
    return count > ZERO and right * right + down * down < reach * reach


@kernel
def lose_confidence(name, state, screen, count, doubt, doubt_about, stale, since):
    """Let samples lose confidence: those beneath a contradiction, and those of tiles that have changed as a whole.

    Parameters
    ----------
    name : (capacity,) int32, object ids; state : (2, capacity) float32, time and confidence, the latter updated
    screen : (3, capacity) float32, x, y, depth in the picture that was doubted
    doubt : (h, w, 2) float32, how much was contradicted and when; doubt_about : (h, w) int32, whose surface
    stale : (rows, columns) float32, share of confidence that each tile's samples from before `since` lose
    """
    for k in range(count):
        if not screen[2, k] > ZERO:
            continue
        i, j = int(screen[1, k]), int(screen[0, k])
        time = state[0, k]
        if doubt[i, j, 0] > ZERO and doubt_about[i, j] == name[k] and time < doubt[i, j, 1]:
            state[1, k] *= ONE - doubt[i, j, 0]
        if time < since:
            state[1, k] *= ONE - stale[i // TILE, j // TILE]
        if state[1, k] < FORGOTTEN:
            state[1, k] = ZERO


@kernel
def place_samples(place, name, count, table, moved, right, bottom, screen):
    """Place every sample whose object moved on the screen, a run of one object at a time.

    place : (3, capacity) float32, object-local; name : (capacity,) int32; table : (n + 1, 12) float32
    moved : (n + 1,) uint8, whose row of the table differs from last time's; right, bottom : float32, picture pixels
    screen : (3, capacity) float32, written: x, y, depth (OUTSIDE where it is not in the picture)
    """
    first = 0
    while first < count:
        k = name[first]
        last = first + 1
        while last < count and name[last] == k:
            last += 1
        if moved[k] != 0:
            place_run(place, first, last, table[k], k == 0, right, bottom, screen)
        first = last


@inline_kernel
def place_run(place, first, last, m, sky, right, bottom, screen):
    """The samples of one object: nothing but arithmetic, so that it becomes vector code."""
    m0, m1, m2, m3 = m[0], m[1], m[2], m[3]
    m4, m5, m6, m7 = m[4], m[5], m[6], m[7]
    m8, m9, m10, m11 = m[8], m[9], m[10], m[11]
    for k in range(first, last):
        a, b, c = place[0, k], place[1, k], place[2, k]
        w = m0 * a + m1 * b + m2 * c + m3
        inverse = ONE / w
        x = (m4 * a + m5 * b + m6 * c + m7) * inverse
        y = (m8 * a + m9 * b + m10 * c + m11) * inverse
        inside = (w > NEAREST) & (x >= ZERO) & (y >= ZERO) & (x < right) & (y < bottom)
        z = FAR if sky else w
        screen[0, k] = x
        screen[1, k] = y
        screen[2, k] = z if inside else OUTSIDE


@kernel
def keep_nearest(name, state, screen, count, nearest):
    """Each pixel's nearest sample. Forgotten samples leave the picture.

    nearest : (h, w, 4) float32, written: depth (inf where nothing is), x, y in the picture, object id (-1)

    Returns
    -------
    alive : int, samples in the picture
    """
    for i in range(nearest.shape[0]):
        for j in range(nearest.shape[1]):
            nearest[i, j, 0], nearest[i, j, 3] = np.inf, -ONE
    alive = 0
    for k in range(count):
        z = screen[2, k]
        if not z > ZERO:
            continue
        if state[1, k] == ZERO:
            screen[2, k] = OUTSIDE
            continue
        alive += 1
        x, y = screen[0, k], screen[1, k]
        i, j = int(y), int(x)
        a, b, c, d = nearest[i, j, 0], nearest[i, j, 1], nearest[i, j, 2], nearest[i, j, 3]
        closer = z < a  # as likely as not: selecting costs less than guessing
        nearest[i, j, 0] = z if closer else a
        nearest[i, j, 1] = x if closer else b
        nearest[i, j, 2] = y if closer else c
        nearest[i, j, 3] = np.float32(name[k]) if closer else d
    return alive


@kernel
def splat(colour, state, screen, count, cutoff, nearest, front, now, young, decay, gathered, lighting):
    """Add what is seen to the picture; what is hidden waits or dies, what is too old dies.

    A sample spreads over the four nearest pixel centres by a tent, weighed by confidence and age. Samples younger than
    `young` seconds are never hidden: what they hide may not have been seen yet.

    Parameters
    ----------
    colour : (capacity, 4) float32, radiance and square root of lighting; state : (2, capacity) float32
    screen : (3, capacity) float32; what dies gets depth OUTSIDE and no confidence
    cutoff : float32 seconds of the store's clock; samples from before it die
    nearest, front : see keep_nearest and front_depths
    now, young : float32 seconds of the store's clock
    decay : (rows, columns) float32, 1 / seconds, how fast old samples lose weight in each tile
    gathered : (h + 2, w + 2, 4) float32, weighted radiance and weight, written
    lighting : (h, w, 2) float32, weighted square root of lighting and weight, each sample in its own pixel, written;
        | None
    """
    gathered[:] = ZERO
    if lighting is not None:
        lighting[:] = ZERO
    for k in range(count):
        z = screen[2, k]
        if not z > ZERO:
            continue
        x, y = screen[0, k], screen[1, k]
        i, j = int(y), int(x)
        time = state[0, k]
        age = now - time
        covered = z > front[i, j, 0] and age > young and (z > front[i, j, 1] or hidden(x, y, z, nearest))
        if covered and age < WAITS and time >= cutoff:
            continue
        if covered or time < cutoff:
            screen[2, k] = OUTSIDE
            state[1, k] = ZERO
            continue
        a = max(age, ZERO) * (decay[i // TILE, j // TILE] + front[i, j, 2])
        weight = state[1, k] / (ONE + a * (ONE + a * (HALF + a * np.float32(1.0 / 6.0))))
        red, green, blue = colour[k, 0], colour[k, 1], colour[k, 2]
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
            lighting[i, j, 0] += weight * colour[k, 3]
            lighting[i, j, 1] += weight


@inline_kernel
def add(gathered, i, j, red, green, blue, weight):
    gathered[i, j, 0] += weight * red
    gathered[i, j, 1] += weight * green
    gathered[i, j, 2] += weight * blue
    gathered[i, j, 3] += weight


@kernel
def sort_store(
    place, name, colour, state, screen, surface, albedo, count, by_tile, columns, starts, place_out, name_out,
    colour_out, state_out, screen_out, surface_out, albedo_out,
):  # fmt: skip
    """Copy what lives to a second store, in the order of tiles or of objects, and return how many that are.

    by_tile : bool; columns : int, tiles in a row; starts : (1 + objects or tiles,) int64, scratch
    Samples that are outside the picture or forgotten are left behind. The order within a key stays.
    """
    starts[:] = 0
    for k in range(count):
        if screen[2, k] > ZERO:
            starts[sort_key(name, screen, k, by_tile, columns) + 1] += 1
    for n in range(1, starts.shape[0]):
        starts[n] += starts[n - 1]
    kept = starts[-1]
    for k in range(count):
        if not screen[2, k] > ZERO:
            continue
        n = sort_key(name, screen, k, by_tile, columns)
        j = starts[n]
        starts[n] += 1
        name_out[j] = name[k]
        for c in range(3):
            place_out[c, j] = place[c, k]
            screen_out[c, j] = screen[c, k]
        for c in range(4):
            colour_out[j, c] = colour[k, c]
        state_out[0, j], state_out[1, j] = state[0, k], state[1, k]
        if albedo.shape[1] > 0:
            surface_out[j] = surface[k]
            for c in range(3):
                albedo_out[c, j] = albedo[c, k]
    return kept


@inline_kernel
def sort_key(name, screen, k, by_tile, columns):
    if by_tile:
        return int(screen[1, k]) // TILE * columns + int(screen[0, k]) // TILE
    return np.int64(name[k])


@kernel
def doubt_still(still, nearest, moved, doubt):
    """What pixels gathered while they stood still: gone where what they show moves, less where it was contradicted.

    still : (h, w, 8) float32: radiance sums (3), count, mean and squared deviations of
        sqrt luminance, the same of sqrt lighting; updated
    nearest : (h, w, 4) float32, see keep_nearest; moved : (n + 1,) uint8; doubt : (h, w, 2) float32, cleared
    """
    for i in range(nearest.shape[0]):
        for j in range(nearest.shape[1]):
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
                    n = still[i, j, 3]
                    part = ONE / ((ONE + n) * (ONE + n))
                    own = (ONE - part) / max(n, np.float32(1e-6))
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
    height, width = nearest.shape[0], nearest.shape[1]
    for k in range(samples.shape[0]):
        if count >= name.shape[0]:
            break
        sample = samples[k]
        thing = int(sample["object"])
        if thing >= object_from_eye.shape[0]:
            continue
        x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
        a, b, c = place_of(x, y, sample["depth"], thing, frame, object_from_eye)
        place[0, count], place[1, count], place[2, count] = a, b, c
        name[count] = thing
        red, green, blue = sample["radiance"][0], sample["radiance"][1], sample["radiance"][2]
        light = sample["light"]
        colour[count, 0], colour[count, 1], colour[count, 2], colour[count, 3] = red, green, blue, light
        if albedo.shape[1] > 0:
            surface[count] = surface_of(sample)
            albedo[0, count] = NOT_RELIT
            if matt[thing] != 0:
                remember_colour(sample, a, b, c, lamps[thing], suns, up[thing], irradiance, surface, albedo, count)
        time = offset + sample["time"]
        state[0, count], state[1, count] = time, ONE
        u, v, z = pixel_of(a, b, c, thing, table)
        if not (u >= ZERO and v >= ZERO and u < width and v < height):
            z = OUTSIDE
        screen[0, count], screen[1, count], screen[2, count] = u, v, z
        count += 1
        if not z > ZERO:
            continue
        i, j = int(v), int(u)
        dirty[i // TILE, j // TILE] = True
        if steady and still[i, j, 3] >= stored:
            count -= 1  # only its pixel's mean gains; stored, it would drive plain surfaces' few samples out
        if not still_mode:
            change = sample["change"]
            if judging:
                change = ZERO
                if nearest[i, j, 3] == thing and lighting[i, j, 1] > TRUSTED:
                    known = still[i, j, 3] >= KNOWN
                    was = still[i, j, 6] if known else lighting[i, j, 0] / lighting[i, j, 1]
                    difference = abs(light - was)
                    if difference > SMALL_CHANGE:
                        if known:
                            noise = SIGMAS * np.sqrt(still[i, j, 7] / still[i, j, 3])
                        else:
                            noise = NOISE * spread_of(lighting, nearest, i, j, thing)
                        difference = max(difference - noise, ZERO)
                    change = min(max((difference - SMALL_CHANGE) * PER_CHANGE, ZERO), ONE)
                    tile = residual[i // TILE, j // TILE]
                    residual[i // TILE, j // TILE] = tile + RESIDUAL_SHARE * (difference - tile)
                sample["change"] = change
            probes[i // TILE, j // TILE, 0] += ONE
            probes[i // TILE, j // TILE, 1] += change
            if change > ZERO:
                spread_doubt(doubt, doubt_about, i, j, change, time, thing)
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
