"""Data made here, to try things with: named in place of a file, as built-in scenes are."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64

STARS = 200_000
SEED = 7
ARMS, WINDING = 2, 6.0  # of the galaxy; radians that an arm turns from the middle to the rim
BULGE = 0.16  # share of the stars that are in the middle
GRID = 96  # points of a field along each axis
SKIN = 120  # spheres along an edge of a drum's skin
STEP = 0.008  # of time along curves
REACH = 28.0  # of a field, from the middle; Bohr radii


def galaxy(count: int = STARS) -> dict[str, NDArray[Any]]:
    """Stars of a spiral galaxy of radius 1 in the plane y = 0: x, y, z, size, speed; the same every time."""
    chance = np.random.default_rng(SEED)
    middle = chance.random(count) < BULGE
    out = np.where(middle, 0.14 * np.abs(chance.standard_normal(count)), chance.beta(1.3, 2.0, count))
    arm = 2.0 * np.pi / ARMS * chance.integers(0, ARMS, count) + WINDING * np.sqrt(out)
    turn = np.where(middle, chance.uniform(0.0, 2.0 * np.pi, count), arm + _scattered(chance, count))
    height = np.where(middle, 0.10, 0.012 + 0.02 * out) * chance.standard_normal(count) * np.exp(-2.0 * out)
    columns = {
        "x": out * np.cos(turn),
        "y": height,
        "z": out * np.sin(turn),
        "size": 0.6 + chance.pareto(3.0, count).clip(0.0, 4.0),
        "speed": 240.0 * (1.0 - np.exp(-3.0 * out)) + 8.0 * chance.standard_normal(count),
    }
    return {name: values.astype(np.float32) for name, values in columns.items()}


def _scattered(chance: np.random.Generator, count: int) -> Float64:
    """(count,) turns from the arms, radians: most near, a fifth anywhere."""
    near, wide = 0.17 * chance.standard_normal(count), chance.uniform(-np.pi / ARMS, np.pi / ARMS, count)
    return np.where(chance.random(count) < 0.2, wide, near)


def orbital(points: int = GRID) -> tuple[dict[str, Float32], float]:
    """An electron's orbital, 4f xyz of hydrogen: arrays (z, y, x) on a grid about the origin, and the grid's spacing.

    density : of probability over its greatest; phase : of the wave, -1 or 1, smooth between; radius : Bohr radii
    """
    axis = np.linspace(-REACH, REACH, points)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    radius = np.sqrt(x * x + y * y + z * z)
    wave = x * y * z * np.exp(-radius / 4.0)
    wave /= np.abs(wave).max()
    fields = {"density": wave**2, "phase": np.tanh(4.0 * wave), "radius": radius}
    return {name: values.astype(np.float32) for name, values in fields.items()}, float(axis[1] - axis[0])


def drum(step: int) -> dict[str, Float32]:
    """A square skin of spheres that swings, 2 wide, about the plane y = 0: x, y, z, height; the same again after STEPS.

    Two waves of a square skin, which run twice and three times in a period.
    """
    edge = np.linspace(-1.0, 1.0, SKIN)
    x, z = (each.ravel() for each in np.meshgrid(edge, edge, indexing="ij"))
    turn = 2.0 * np.pi * step / STEPS["drum"]
    first = np.cos(1.5 * np.pi * x) * np.cos(0.5 * np.pi * z) * np.cos(2.0 * turn)
    height = 0.15 * (first + np.sin(np.pi * x) * np.sin(2.0 * np.pi * z) * np.cos(3.0 * turn))
    columns = {"x": x, "y": height, "z": z, "height": height}
    return {name: values.astype(np.float32) for name, values in columns.items()}


def lorenz(curves: int = 24, points: int = 1500) -> dict[str, NDArray[Any]]:
    """Ways through the Lorenz attractor, from near each other to everywhere: x, y, z, speed, curve.

    E. N. Lorenz, "Deterministic nonperiodic flow", 1963; y is up, and what was 27 there is the middle.
    """
    places = np.random.default_rng(SEED).normal((1.0, 1.0, 20.0), 0.02, (curves, 3)).T
    ways, speeds = np.empty((points, 3, curves)), np.empty((points, curves))

    def flow(at: Float64) -> Float64:
        x, y, z = at
        return np.stack([10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z])

    for k in range(points):
        ways[k], speeds[k] = places, np.linalg.norm(flow(places), axis=0)
        middle = places + 0.5 * STEP * flow(places)
        places = places + STEP * flow(middle)
    x, y, z = (ways[:, axis].T.ravel().astype(np.float32) for axis in range(3))
    speed, curve = speeds.T.ravel().astype(np.float32), np.repeat(np.arange(curves), points)
    return {"x": x, "y": z - np.float32(27.0), "z": y, "speed": speed, "curve": curve}


POINTS = {"galaxy": galaxy}
CURVES = {"lorenz": lorenz}
FIELDS = {"orbital": orbital}
POINT_STEPS = {"drum": drum}
STEPS = {"drum": 60}  # of series
BUILT_IN_DATA = frozenset({*POINTS, *CURVES, *FIELDS, *POINT_STEPS})
