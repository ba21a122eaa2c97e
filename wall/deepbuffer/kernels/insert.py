"""Insert samples: store them as points of their objects, compare them with the image, accumulate them at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.albedo import light_of, unpack_albedo
from wall.deepbuffer.kernels.accumulation import BITS, accumulate, object_bit
from wall.deepbuffer.kernels.change import KNOWN_ALONE, TRUSTED, change_of, mark_contradicted
from wall.deepbuffer.kernels.columns import (
    COUNT,
    DEPTH,
    IRRADIANCE,
    IRRADIANCE_MEAN,
    NEAREST_OBJECT,
    OBJECTS,
    SQRT_IRRADIANCE,
    WEIGHT,
    X,
    Y,
    Z,
)  # fmt: skip
from wall.deepbuffer.kernels.lights import demodulate, pack_normal
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import OUTSIDE, position_of
from wall.deepbuffer.kernels.reproject_rows import pixel_in

ZERO, ONE = np.float32(0.0), np.float32(1.0)
CHUNK = 64  # samples: first everything that they are compared with is fetched, which memory does for many at a time
STRAY = np.float32(0.5)  # pixels: an eye so near a surface that float32 does not know how far it is
LEAST_DEPTH = np.float32(1e-30)
UNKNOWN_OBJECT = np.float32(-2.0)  # depth of a sample whose object does not exist
# rows of a chunk: object-space position (X, Y, Z), then
SCREEN_X, SCREEN_Y, SCREEN_DEPTH, SHOWN_IRRADIANCE, ACCUMULATED, ROWS = 3, 4, 5, 6, 7, 8


class InsertRules(NamedTuple):
    """How a batch is inserted."""

    shows_event: bool  # the samples belong to the image as it is shown: their pixels accumulate them
    ignores_change: bool  # nothing moves: changes are noise
    most_stored: np.float32  # a pixel that has accumulated so many samples stores no more
    detects_change: bool  # else the samples bring `change` along
    of_shown_pose: bool  # the samples are of the very moment shown: each belongs to the pixel that it was traced for
    left: np.float32  # panel pixels, of the image
    top: np.float32


@kernel
def insert(samples, offset, pose, panel_from_object, image_rows, store, count, history, diffuse, rules):
    """Store a batch of samples and bring the pixels' history up to date.

    Parameters
    ----------
    samples : (n,) SAMPLE; `change` is written if changes are detected
    offset : float32, seconds from the store's clock zero to the batch's base time
    pose : Pose that the samples were traced under
    panel_from_object : (n + 1, 12) float32, of the image
    image_rows : RowTables of the image; None: all its rows are seen at once
    store : SampleStore, written from `count` on
    history : PixelHistory, updated
    diffuse : Diffuse
    rules : InsertRules

    Returns
    -------
    count : int, samples stored now
    """
    nearest, accumulation = history.nearest, history.accumulation
    compares = rules.detects_change and not rules.ignores_change
    rows = np.empty((ROWS, CHUNK), np.float32)
    for first in range(0, samples.shape[0], CHUNK):
        last = min(first + CHUNK, samples.shape[0])
        find_positions(samples, first, last, pose, panel_from_object, image_rows, nearest.shape, rules, rows)
        if compares:
            fetch_shown(samples, first, last, history, panel_from_object.shape[0] <= BITS, rows)
        for k in range(first, last):
            if count >= store.object_id.shape[0]:
                return count
            sample, r = samples[k], k - first
            object_id, depth = int(sample["object_id"]), rows[SCREEN_DEPTH, r]
            if depth == UNKNOWN_OBJECT:
                continue
            shown = depth > ZERO
            i, j = (int(rows[SCREEN_Y, r]), int(rows[SCREEN_X, r])) if shown else (0, 0)
            time = offset + sample["time"]
            # a pixel with a long accumulation gains from its mean; its samples would drive out plain surfaces' few
            if not (shown and rules.shows_event and accumulation[i, j, COUNT] >= rules.most_stored):
                store_sample(sample, time, rows, r, pose.lights, diffuse, store, count)
                count += 1
            if not shown:
                continue
            history.dirty[i // TILE, j // TILE] = True
            history.arrived[i // TILE, j // TILE] += 1
            if not (rules.ignores_change or history.settled[i, j]):
                change = sample["change"]
                if compares:
                    own, known = sample["sqrt_irradiance"], rows[SHOWN_IRRADIANCE, r]
                    change = change_of(own, known, rows[ACCUMULATED, r], i, j, object_id, history)
                    sample["change"] = change
                if change > ZERO:
                    mark_contradicted(history, i, j, change, time, object_id)
            if rules.shows_event:
                accumulate(history, i, j, sample)
    return count


@inline_kernel
def find_positions(samples, first, last, pose, panel_from_object, image_rows, shape, rules, rows):
    """Fill rows X to SCREEN_DEPTH of a chunk; the depth is OUTSIDE beyond the image, or UNKNOWN_OBJECT."""
    bottom, right = np.float32(shape[0]), np.float32(shape[1])
    corner, object_from_eye = pose.corner, pose.object_from_eye
    for k in range(first, last):
        sample, r = samples[k], k - first
        object_id = int(sample["object_id"])
        if object_id >= object_from_eye.shape[0]:
            rows[SCREEN_DEPTH, r] = UNKNOWN_OBJECT
            continue
        x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
        a, b, c = position_of(x, y, sample["depth"], object_id, pose.frame, object_from_eye)
        rows[X, r], rows[Y, r], rows[Z, r] = a, b, c
        u, v, depth = pixel_in(a, b, c, object_id, panel_from_object, image_rows)
        if rules.of_shown_pose:
            own_u, own_v = sample["xy"][0] - rules.left, sample["xy"][1] - rules.top
            if not (abs(u - own_u) < STRAY and abs(v - own_v) < STRAY and depth > ZERO):
                depth = max(sample["depth"], LEAST_DEPTH)
            u, v = own_u, own_v
        rows[SCREEN_X, r], rows[SCREEN_Y, r] = u, v
        rows[SCREEN_DEPTH, r] = depth if u >= ZERO and v >= ZERO and u < right and v < bottom else OUTSIDE


@inline_kernel
def fetch_shown(samples, first, last, history, told_apart, rows):
    """Fill rows SHOWN_IRRADIANCE (-1: not known, or of another object) and ACCUMULATED of a chunk.

    told_apart : bool, no two objects share a bit: then a mean tells of whose samples it is
    """
    irradiance, nearest, accumulation = history.sqrt_irradiance, history.nearest, history.accumulation
    for k in range(first, last):
        r = k - first
        rows[SHOWN_IRRADIANCE, r] = -ONE
        if rows[SCREEN_DEPTH, r] > ZERO:
            i, j = int(rows[SCREEN_Y, r]), int(rows[SCREEN_X, r])
            light, weight = irradiance[i, j, IRRADIANCE], irradiance[i, j, WEIGHT]
            known = (nearest[i, j, NEAREST_OBJECT] == samples[k]["object_id"]) & (weight > TRUSTED)
            rows[SHOWN_IRRADIANCE, r] = light / weight if known else -ONE
            rows[ACCUMULATED, r] = accumulation[i, j, COUNT]
            alone = nearest[i, j, NEAREST_OBJECT] < ZERO and accumulation[i, j, COUNT] >= KNOWN_ALONE  # none is stored
            if alone and told_apart and accumulation[i, j, OBJECTS] == object_bit(samples[k]["object_id"]):
                rows[SHOWN_IRRADIANCE, r] = accumulation[i, j, IRRADIANCE_MEAN]


@inline_kernel
def store_sample(sample, time, rows, r, lights, diffuse, store, k):
    """Write a sample to slot k of the store; its positions are column r of a chunk's rows."""
    store.position[X, k], store.position[Y, k], store.position[Z, k] = rows[X, r], rows[Y, r], rows[Z, r]
    store.object_id[k] = sample["object_id"]
    for c in range(3):
        store.radiance[k, c] = sample["radiance"][c]
    store.radiance[k, SQRT_IRRADIANCE] = sample["sqrt_irradiance"]
    if store.normal.shape[0] > 0:
        store.normal[k] = pack_normal(sample["normal"][0], sample["normal"][1])
    if store.light_visibility.shape[0] > 0:
        store.light_visibility[k] = sample["light_visibility"]
        demodulate(sample, lights, diffuse, store, k)
    if store.light.shape[0] > 0:
        albedo, light = unpack_albedo(sample["albedo"]), light_of(sample)
        for c in range(3):
            store.albedo[c, k], store.light[k, c] = albedo[c], light[c]
    store.time[k], store.confidence[k] = time, ONE
    store.screen_position[X, k] = rows[SCREEN_X, r]
    store.screen_position[Y, k] = rows[SCREEN_Y, r]
    store.screen_position[DEPTH, k] = rows[SCREEN_DEPTH, r]
