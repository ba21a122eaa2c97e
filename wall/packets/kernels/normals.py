"""Normals and lamps of samples, as the compact body carries them: only what differs from the object's last sample."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.packets.kernels.bit_planes import get_all, get_plane, put_all, put_plane

NORMAL_CODES = 31  # to either side of 0; 127 at both ends
LAMP_BITS = 16
TURNED, RELIT = 8, 16  # flags of a tile: some normal differs, some lamps differ
NORMAL_MEAN, LAMP_MEAN = 2, 1  # before the first number of a plane


@inline_kernel
def normal_code(component):
    """Nearest code of an int8 component; there are no ties."""
    return (2 * NORMAL_CODES * np.int64(component) + 127) // 254


@inline_kernel
def normal_of(code):
    """Its inverse, within 2 of 127."""
    return (254 * np.int64(code) + NORMAL_CODES) // (2 * NORMAL_CODES)


@inline_kernel
def hidden_lights(sample):
    """The inverted light visibility mask of a sample: its first LAMP_BITS bits, which the wire carries, of 32."""
    every = np.uint32((1 << LAMP_BITS) - 1)
    return np.int64(every ^ (sample["light_visibility"] & every))


@kernel
def exchange(who, lamps, known, reading):
    """lamps (n,) int32 become their exclusive or with those of the last sample of the same object, or back.

    who : (n,) int32, places in the palette; known : its size; reading : bool, back
    """
    last, seen = np.empty(known, np.int64), np.zeros(known, np.bool_)
    before = np.int64(0)
    for i in range(who.shape[0]):
        mine, value = who[i], np.int64(lamps[i])
        if not seen[mine]:
            seen[mine], last[mine] = True, before
        lamps[i] = value ^ last[mine]
        before = np.int64(lamps[i]) if reading else value
        last[mine] = before


@kernel
def flag_facing(facing, begins, flags):
    """Raise flags (m,) of tiles from facing (3, n) int32, folded differences of normals and exchanged lamps.

    begins : (m + 1,) int64, first samples of tiles
    """
    for t in range(flags.shape[0]):
        turned = relit = np.int64(0)
        for i in range(begins[t], begins[t + 1]):
            turned |= facing[0, i] | facing[1, i]
            relit |= facing[2, i]
        flags[t] |= (TURNED if turned else 0) | (RELIT if relit else 0)


@kernel
def put_facing(facing, begins, flags, words, at):
    """Append what flagged tiles tell, see flag_facing. at : see put_all"""
    n = facing.shape[1]
    signs, lamps = np.empty(n, np.int32), np.empty(n, np.int32)
    normals = np.empty((2, n), np.int32)
    told = turned = relit = 0
    for t in range(flags.shape[0]):
        for i in range(begins[t], begins[t + 1]):
            if flags[t] & TURNED:
                differs = (facing[0, i] | facing[1, i]) != 0
                signs[told] = differs
                told += 1
                if differs:
                    normals[0, turned], normals[1, turned] = facing[0, i], facing[1, i]
                    turned += 1
            if flags[t] & RELIT:
                lamps[relit] = facing[2, i]
                relit += 1
    put_all(signs[:told], 1, words, at)
    put_plane(normals[0, :turned], NORMAL_MEAN, words, at)
    put_plane(normals[1, :turned], NORMAL_MEAN, words, at)
    put_plane(lamps[:relit], LAMP_MEAN, words, at)


@kernel
def read_facing(words, position, starts, flags, facing):
    """The inverse: facing (3, n) int32, zeros, is filled. Returns the position, -1 if a lamp is out of range."""
    told = relit = turned = 0
    for t in range(flags.shape[0]):
        told += starts[t + 1] - starts[t] if flags[t] & TURNED else 0
        relit += starts[t + 1] - starts[t] if flags[t] & RELIT else 0
    signs, lamps = np.empty(told, np.int32), np.empty(relit, np.int32)
    position = get_all(signs, 1, words, position)
    for i in range(told):
        turned += signs[i]
    normals = np.empty((2, turned), np.int32)
    for c in range(2):
        position = get_plane(normals[c], NORMAL_MEAN, words, position)
    position = get_plane(lamps, LAMP_MEAN, words, position)
    told = relit = turned = 0
    for t in range(flags.shape[0]):
        for i in range(starts[t], starts[t + 1]):
            if flags[t] & TURNED:
                if signs[told]:
                    facing[0, i], facing[1, i] = normals[0, turned], normals[1, turned]
                    turned += 1
                told += 1
            if flags[t] & RELIT:
                facing[2, i] = lamps[relit]
                relit += 1
                if facing[2, i] >> LAMP_BITS:
                    return np.int64(-1)
    return position


@kernel
def restore_facing(facing, samples):
    """Normals and visible lights of samples (n,) SAMPLE from codes (3, n) int32, zero from (0, n).

    Returns False if a normal is out of range.
    """
    for i in range(samples.shape[0]):
        u = v = np.int64(0)
        samples[i]["light_visibility"] = np.uint32(0)
        if facing.shape[0] > 0:
            u, v = np.int64(facing[0, i]), np.int64(facing[1, i])
            samples[i]["light_visibility"] = np.uint32(0xFFFFFFFF) ^ np.uint32(facing[2, i])
        if max(abs(u), abs(v)) > NORMAL_CODES:
            return False
        samples[i]["normal"][0], samples[i]["normal"][1] = normal_of(u), normal_of(v)
    return True
