"""What packets round beside colours and places: albedos, masks of lights, rotations. The worst values are searched."""

from __future__ import annotations

import numpy as np

from wall.core.data import Camera
from wall.core.kernels.albedo import FLOOR, pack_albedo, unpack_albedo
from wall.packets.samples import decode, encode
from wall.study.accuracy.case import Case, Found
from wall.study.accuracy.wire import at_borders, batch_of, samples_of, through

LIGHTS = 32  # bits of a mask
LEAST_STEP = 1e-12  # of a search


def albedo_error(between: int) -> Found:
    """Largest error of an albedo's square root over half a code, at the borders of codes and between.

    Codes of the three channels differ, so that one in another's place would show.
    """
    borders = at_borders(((np.arange(256) + 0.5) / 255.0) ** 2)
    values = np.concatenate([borders, np.linspace(FLOOR, 1.0, between, dtype=np.float32)])
    values = values[(values >= FLOOR) & (values <= 1.0)]
    others = np.roll(values, 1), np.roll(values, 2)
    codes = [pack_albedo(*channels) for channels in zip(values, *others, strict=True)]
    came = through(samples_of(len(codes), radiance=0.5, albedo=codes), adaptive=True, noisy=True)["albedo"]
    shares = np.array([unpack_albedo(code) for code in came], np.float64)
    sent = np.stack([values, *others], axis=1).astype(np.float64)
    errors = np.abs(np.sqrt(shares) - np.sqrt(sent)) * 510.0
    return Found(figure=float(errors.max()), note=f"worst at {sent.flat[errors.argmax()]:.8g}, of {len(codes):,}")


def light_masks(random: int) -> Found:
    """Masks of visible lights that do not arrive as they were sent."""
    bits = [1 << k for k in range(LIGHTS)]
    whole = (1 << LIGHTS) - 1
    chosen = np.random.default_rng(3).integers(0, whole, random, dtype=np.uint32, endpoint=True)
    masks = np.array([0, whole, *bits, *(whole - bit for bit in bits), *chosen], np.uint32)
    sent = samples_of(len(masks), radiance=0.5, light_visibility=masks)
    came = through(sent, adaptive=True, relightable=True)["light_visibility"]
    return Found(figure=int((came != masks).sum()), note=f"of {len(masks):,} masks")


def rotation_error(tries: int) -> Found:
    """Largest error of an element of a pose's rotation behind a packet, in roundings of float64.

    Searched from turns where a quaternion is hardest to tell: by 180 degrees, where components are equal, by next to
    nothing, and any. What a search finds worst it goes on from.
    """
    random = np.random.default_rng(5)
    hard = [(0.0, 1.0, 0.0, 0.0), (1e-9, 0.0, 1.0, 1e-9), (1.0, 1.0, 1.0, 1.0), (1.0, 1e-9, -1e-9, 1e-17)]
    worst, where, step = -1.0, np.array(hard[0]), 1.0
    for k in range(tries):
        tried = np.array(hard[k]) if k < len(hard) else where + step * random.normal(size=4)
        found = _turned_by(tried / np.linalg.norm(tried))
        better = found > worst
        worst, where = (found, tried) if better else (worst, where)
        step = 1.0 if step < LEAST_STEP else step if better else 0.7 * step
    return Found(figure=worst, note="worst by the quaternion " + ", ".join(f"{x:.3g}" for x in where))


def _turned_by(quaternion: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    """The error, roundings of float64, with which a rotation arrives."""
    w, x, y, z = quaternion.tolist()
    turn = (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip
    batch = batch_of(samples_of(1), camera=Camera(position=(0.0, 0.0, 0.0), world_from_wall=turn))
    came = decode(encode(batch)).camera.world_from_wall
    off: float = max(abs(a - b) for a, b in zip(came, turn, strict=True))
    return off * 2.0**53


_FAMILY = "Packets"
CASES = (
    Case(
        name="albedo", family=_FAMILY, unit="half codes of the square root", bound=1.0001,
        reason="a code of 8 bits is the nearest one; float32 adds some 4 roundings of 255 steps",
        scene="Albedos of paths from 0.04 to 1 at the borders of their codes", measure=albedo_error, size=65536,
        small=256,
    ),
    Case(
        name="light_masks", family=_FAMILY, unit="masks", bound=0.0,
        reason="a bit says whether a light reaches a point: none may turn",
        scene="Masks of 32 lights: none, all, each alone, all but one, and any", measure=light_masks, size=65536,
        small=256,
    ),
    Case(
        name="rotation", family=_FAMILY, unit="roundings of float64", bound=32.0,
        reason="a component is a root of three sums or a sum over it, some 6 roundings; an element is made of two "
        "products of two of them, each doubled",
        scene="Turns of a pose, searched for the one that a quaternion brings back worst", measure=rotation_error,
        size=20_000, small=400,
    ),
)  # fmt: skip
