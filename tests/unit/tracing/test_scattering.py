"""Densities and random numbers of paths: what `sample` draws is what `evaluate` says, and points are spread evenly."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.tracing.interface import interface_table
from wall.tracing.kernels import facet_walk, ggx, opaque, thin_glass
from wall.tracing.kernels.random_numbers import random_pair
from wall.tracing.kernels.values import MATERIAL

pytestmark = pytest.mark.usefixtures("compiled_only")  # hundreds of thousands of directions and points
TABLE = interface_table()
COUNT = 400_000
RINGS, SECTORS = 12, 16  # of the hemisphere, equal in solid angle


@numba.njit
def drawn(rows: Any, table: Any, out: Any, numbers: Any, to: Any) -> None:
    row = rows[0]
    albedo = row["base_color"][0], np.float32(0.5), np.float32(0.3)
    look = opaque.look_of(row, row["metallic"], row["roughness"], albedo, out[2], table)
    for k in range(len(numbers)):
        way, _, density = opaque.sample(look, (out[0], out[1], out[2]), numbers[k, 0], numbers[k, 1], numbers[k, 2])
        to[k, 0], to[k, 1], to[k, 2], to[k, 3] = way[0], way[1], way[2], density


@numba.njit
def valued(rows: Any, table: Any, out: Any, to: Any, values: Any) -> None:
    row = rows[0]
    albedo = row["base_color"][0], np.float32(0.5), np.float32(0.3)
    look = opaque.look_of(row, row["metallic"], row["roughness"], albedo, out[2], table)
    for k in range(len(to)):
        r, g, b, density = opaque.evaluate(look, (out[0], out[1], out[2]), (to[k, 0], to[k, 1], to[k, 2]))
        values[k, 0], values[k, 1], values[k, 2], values[k, 3] = r, g, b, density


@numba.njit
def on_circles(turns: Any, points: Any) -> None:
    for k in range(len(turns)):
        points[k, 0], points[k, 1] = ggx.on_circle(turns[k])


def record(**fields: float) -> NDArray[Any]:
    rows = np.zeros(1, MATERIAL)
    rows["base_color"] = 0.8
    rows["ior"] = 1.5
    for name, value in fields.items():
        rows[name] = value
    return rows


def seen_at(degrees: float) -> NDArray[np.float32]:
    return np.array([math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees))], np.float32)


def bins_of(to: Float64) -> NDArray[np.int64]:
    ring = np.minimum((to[:, 2] * RINGS).astype(int), RINGS - 1)
    sector = ((np.arctan2(to[:, 1], to[:, 0]) / (2 * np.pi) + 1.0) % 1.0 * SECTORS).astype(int)
    return ring * SECTORS + np.minimum(sector, SECTORS - 1)


MATERIALS = [
    {"metallic": 1.0, "roughness": 0.3},
    {"metallic": 1.0, "roughness": 0.9},
    {"specular": 1.0, "roughness": 0.4},
    {"specular": 1.0, "roughness": 0.7, "metallic": 0.5},
    {"roughness": 1.0},
]


@pytest.mark.parametrize("degrees", [0.0, 35.0, 70.0, 85.0])
@pytest.mark.parametrize("fields", MATERIALS)
def test_directions_are_drawn_with_their_density(fields: dict[str, float], degrees: float) -> None:
    """Chi-square over the hemisphere at the 1e-6 level; expected counts from the density on a fine grid in each bin."""
    rows, out = record(**fields), seen_at(degrees)
    to = np.zeros((COUNT, 4), np.float32)
    drawn(rows, TABLE, out, np.random.default_rng(1).random((COUNT, 3)).astype(np.float32), to)
    above = to[to[:, 2] > 0.0].astype(np.float64)
    counts = np.bincount(bins_of(above), minlength=RINGS * SECTORS)
    fine = 48
    heights = (np.arange(RINGS * fine) + 0.5) / (RINGS * fine)
    angles = (np.arange(SECTORS * fine) + 0.5) * 2 * np.pi / (SECTORS * fine)
    z, a = np.meshgrid(heights, angles, indexing="ij")
    ring = np.sqrt(1.0 - z**2)
    grid = np.stack([ring * np.cos(a), ring * np.sin(a), z], axis=-1).reshape(-1, 3)
    values = np.zeros((len(grid), 4), np.float32)
    valued(rows, TABLE, out, grid.astype(np.float32), values)
    cell = 2 * np.pi / len(grid)
    expected = np.bincount(bins_of(grid), values[:, 3].astype(np.float64) * cell, RINGS * SECTORS) * COUNT
    used = expected > 20.0
    chi = float((((counts - expected) ** 2) / np.maximum(expected, 1e-9))[used].sum())
    freedom = int(used.sum())
    assert chi < freedom + 6.0 * math.sqrt(2.0 * freedom)
    assert abs(counts[~used].sum() - expected[~used].sum()) < 5.0 * math.sqrt(expected[~used].sum() + 10.0)
    np.testing.assert_allclose(len(above) / COUNT, expected.sum() / COUNT, atol=0.005)


@pytest.mark.parametrize("roughness", [0.05, 0.3, 1.0])
def test_diffuse_light_and_metal_without_compensation_are_reciprocal(roughness: float) -> None:
    """f(o, i) = f(i, o). Compensation depends on the eye's side alone: it is taken out here."""
    rows, rng = record(metallic=1.0, roughness=roughness), np.random.default_rng(3)
    for _ in range(50):
        a, b = rng.normal(size=(2, 3)).astype(np.float32)
        a[2], b[2] = abs(a[2]) + 0.1, abs(b[2]) + 0.1
        a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        both = []
        for out, to in ((a, b), (b, a)):
            value = np.zeros((1, 4), np.float32)
            valued(rows, TABLE, out.astype(np.float32), to[None].astype(np.float32), value)
            both.append(float(value[0, 0]) / float(to[2]) / float(back_of(rows, float(out[2]))))
        assert both[0] == pytest.approx(both[1], rel=2e-3)


def back_of(rows: NDArray[Any], cosine: float) -> float:
    """Red's compensation at a cosine."""
    return float(of_red(rows, TABLE, np.float32(cosine))[0])


@numba.njit
def of_red(rows: Any, table: Any, cosine: Any) -> Any:
    """Its compensation, and what of it is diffuse, seen at a cosine."""
    albedo = (rows[0]["base_color"][0], np.float32(0.5), np.float32(0.3))
    look = opaque.look_of(rows[0], rows[0]["metallic"], rows[0]["roughness"], albedo, cosine, table)
    return look[3][0], look[0][0]


@pytest.mark.parametrize("roughness", [0.05, 0.3, 1.0])
def test_a_coat_is_reciprocal_but_for_its_compensation_and_what_it_leaves_below(roughness: float) -> None:
    """Both depend on the eye's side alone: taken out, the interface over paint is that of metal."""
    rows, rng = record(specular=1.0, roughness=roughness), np.random.default_rng(5)
    for _ in range(50):
        a, b = rng.normal(size=(2, 3)).astype(np.float32)
        b[:2] -= 2.0 * a[:2]  # about the mirrored way, where a smooth coat shines
        a[2], b[2] = abs(a[2]) + 0.1, abs(b[2]) + 0.1
        a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        both = []
        for out, to in ((a, b), (b, a)):
            value, (back, diffuse) = np.zeros((1, 4), np.float32), of_red(rows, TABLE, np.float32(out[2]))
            valued(rows, TABLE, out.astype(np.float32), to[None].astype(np.float32), value)
            both.append((float(value[0, 0]) / float(to[2]) - float(diffuse) / math.pi) / float(back))
        assert both[0] == pytest.approx(both[1], rel=2e-3, abs=1e-6)


@numba.njit
def reflectance(cosine: Any, eta: Any) -> Any:
    return facet_walk.fresnel(np.float32(cosine), np.float32(eta))[0]


def test_glass_reflects_as_fresnel_says_and_wholly_beyond_the_critical_angle() -> None:
    assert reflectance(1.0, 1.5) == pytest.approx(0.04, rel=1e-5)
    brewster = math.atan(1.5)  # only light across the plane of incidence is reflected
    assert reflectance(math.cos(brewster), 1.5) == pytest.approx(0.5 * ((1.5**2 - 1) / (1.5**2 + 1)) ** 2, rel=1e-4)
    critical = math.asin(1 / 1.5)
    assert reflectance(math.cos(critical + 0.01), 1 / 1.5) == 1.0
    assert reflectance(math.cos(critical - 0.01), 1 / 1.5) < 0.7
    for degrees in (0.0, 20.0, 40.0):  # the same from both sides
        inside = math.asin(math.sin(math.radians(degrees)) / 1.5)
        there, back = reflectance(math.cos(math.radians(degrees)), 1.5), reflectance(math.cos(inside), 1 / 1.5)
        assert there == pytest.approx(back, rel=1e-4)


@numba.njit
def sent(table: Any, roughness: Any, out: Any, numbers: Any, to: Any) -> None:
    albedo = np.float32(0.8), np.float32(0.5), np.float32(0.3)
    for k in range(len(numbers)):
        way, weight = thin_glass.sample(
            albedo, np.float32(1.7), np.float32(roughness), table, (out[0], out[1], out[2]),
            numbers[k, 0], numbers[k, 1], numbers[k, 2],
        )  # fmt: skip
        to[k, 0], to[k, 1], to[k, 2], to[k, 3] = way[0], way[1], way[2], weight[0]


@pytest.mark.parametrize("degrees", [0.0, 35.0, 70.0])
@pytest.mark.parametrize("roughness", [0.35, 0.8])
def test_rough_thin_glass_sends_light_where_its_lobes_are(roughness: float, degrees: float) -> None:
    """Both lobes are that of rough reflection, the one behind seen through the sheet: D G / (4 cos) times what the
    facet reflects, or lets pass in its colour; over what facets keep in all. Means of bins against integrals on a fine
    grid, as in test_directions_are_drawn_with_their_density."""
    out = seen_at(degrees)
    to = np.zeros((COUNT, 4), np.float32)
    sent(TABLE, roughness, out, np.random.default_rng(5).random((COUNT, 3)).astype(np.float32), to)
    found = to.astype(np.float64)
    fine, bins = 48, RINGS * SECTORS
    heights, turns = ((np.arange(n * fine) + 0.5) / (n * fine) for n in (RINGS, SECTORS))
    z, a = np.meshgrid(heights, 2 * np.pi * turns, indexing="ij")
    grid = np.stack([np.sqrt(1.0 - z**2) * np.cos(a), np.sqrt(1.0 - z**2) * np.sin(a), z], axis=-1).reshape(-1, 3)
    half = grid + out
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    alpha, facing = roughness**2, half @ out.astype(np.float64)
    facets = alpha**2 / (np.pi * (half[:, 2] ** 2 * (alpha**2 - 1.0) + 1.0) ** 2)
    loss = [(np.sqrt(1.0 + alpha**2 * (1.0 - c**2) / c**2) - 1.0) / 2.0 for c in (grid[:, 2], float(out[2]))]
    lobe = facets / ((1.0 + loss[0] + loss[1]) * 4.0 * out[2])
    lobe /= lobe.mean() * 2.0 * np.pi
    behind = np.sqrt(1.0 - (1.0 - facing**2) / 1.7**2)
    along, across = (1.7 * facing - behind) / (1.7 * facing + behind), (facing - 1.7 * behind) / (facing + 1.7 * behind)
    once = (along**2 + across**2) / 2.0
    mirrored = 2.0 * once / (1.0 + once)
    for side, share in ((1.0, mirrored), (-1.0, 0.8 * (1.0 - mirrored))):
        wanted = np.bincount(bins_of(grid), lobe * share * 2.0 * np.pi / len(grid), bins)
        there = found[found[:, 2] * side > 0.0] * [1.0, 1.0, side, 1.0]
        sums, squares = (np.bincount(bins_of(there), there[:, 3] ** power, bins) / COUNT for power in (1, 2))
        used = np.bincount(bins_of(there), minlength=bins) > 50
        spread = (squares - sums**2) / COUNT
        chi = float((((sums - wanted) ** 2) / np.maximum(spread, 1e-30))[used].sum())
        assert chi < used.sum() + 6.0 * math.sqrt(2.0 * used.sum())
        assert abs((sums - wanted)[~used].sum()) < 1e-3


@numba.njit
def pairs(key: Any, first: Any, count: Any, pair: Any) -> Any:
    points = np.empty((count, 2), np.float32)
    for k in range(count):
        points[k, 0], points[k, 1] = random_pair(np.uint32(key), np.uint32(first + k), pair)
    return points


@pytest.mark.parametrize("key", [0, 1, 0xDEADBEEF])
@pytest.mark.parametrize("pair", [0, 3, 17])
def test_points_of_a_pixel_are_a_net(key: int, pair: int) -> None:
    """Every 2^m points that begin at a multiple of 2^m fill each of the 2^m boxes of 2^-a by 2^-(m - a) once."""
    for m in range(9):
        for start in (0, 1 << m, 5 << m):
            points = pairs(key, start, 1 << m, pair).astype(np.float64)
            assert ((points >= 0.0) & (points < 1.0)).all()
            for a in range(m + 1):
                boxes = (points[:, 0] * 2**a).astype(int) * 2 ** (m - a) + (points[:, 1] * 2 ** (m - a)).astype(int)
                assert len(set(boxes.tolist())) == 1 << m


def test_pixels_and_pairs_do_not_go_with_each_other() -> None:
    one, other, third = pairs(7, 0, 4096, 0), pairs(8, 0, 4096, 0), pairs(7, 0, 4096, 1)
    for a, b in ((one[:, 0], one[:, 1]), (one[:, 0], other[:, 0]), (one[:, 0], third[:, 0]), (one[:, 1], third[:, 1])):
        assert abs(np.corrcoef(a, b)[0, 1]) < 0.06


def test_points_on_a_circle_are_cosines_and_sines() -> None:
    turns = np.linspace(0.0, 1.0, 100_001, dtype=np.float32)
    points = np.zeros((len(turns), 2))
    on_circles(turns, points)
    angles = 2.0 * np.pi * turns.astype(np.float64)
    np.testing.assert_allclose(points, np.stack([np.cos(angles), np.sin(angles)], axis=1), rtol=0.0, atol=1.5e-7)
