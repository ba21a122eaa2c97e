"""Light between the microfacets of rough glass: none is lost, there and back are alike, one facet is a closed form."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest

from wall.core.data import Float32, Float64
from wall.tracing.kernels import facet_walk, glass

pytestmark = pytest.mark.usefixtures("compiled_only")  # hundreds of thousands of walks
COUNT = 400_000
RINGS, SECTORS = 10, 12  # of each hemisphere, equal in solid angle
FINE = 24  # cells of the quadrature across a bin


@numba.njit
def walked(eta: Any, roughness: Any, out: Any, numbers: Any, first_seed: Any, to: Any) -> None:
    for k in range(len(out)):
        three = numbers[k, 0], numbers[k, 1], numbers[k, 2]
        away, seed = (out[k, 0], out[k, 1], out[k, 2]), np.uint32(first_seed + k)
        way, facets = facet_walk.walk(away, np.float32(eta), np.float32(roughness * roughness), three, seed)
        to[k, 0], to[k, 1], to[k, 2], to[k, 3] = way[0], way[1], way[2], facets


@numba.njit
def weighed(eta: Any, roughness: Any, cosine: Any, numbers: Any, weights: Any) -> None:
    out, albedo = (math.sqrt(np.float32(1.0) - cosine * cosine), np.float32(0.0), cosine), (cosine, cosine, cosine)
    for k in range(len(numbers)):
        three = numbers[k, 0], numbers[k, 1], numbers[k, 2]
        way, weight = glass.sample(albedo, np.float32(eta), np.float32(roughness), out, three, np.uint32(k))
        weights[k, 0], weights[k, 1] = way[2], weight[0]


def walks(eta: float, roughness: float, out: Float32, seed: int) -> Float64:
    """(n, 4) directions, and how many facets each met."""
    chance, to = np.random.default_rng(seed), np.zeros((len(out), 4), np.float32)
    walked(eta, roughness, out, chance.random((len(out), 3), dtype=np.float32), int(chance.integers(1 << 31)), to)
    return to.astype(np.float64)


def loss(cosine: Float64, alpha: float) -> Float64:
    """Smith's Lambda."""
    return (np.sqrt(1.0 + alpha**2 * (1.0 - cosine**2) / cosine**2) - 1.0) / 2.0


def of_one_facet(out: Float64, to: Float64, eta: float, alpha: float) -> Float64:
    """Density of light that leaves after one facet: Walter et al. 2007, with the shadowing of facets at heights: on one
    side both are hidden by what is higher, 1 / (1 + a + b), on two sides one of them by what is lower,
    B(1 + a, 1 + b) (Heitz 2014). to : (n, 3)
    """
    above = to[:, 2:] > 0.0
    half = np.where(above, out + to, -(out + eta * to)) * (1.0 if eta > 1.0 else np.where(above, 1.0, -1.0))
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    half = np.where(half[:, 2:] < 0.0, -half, half)
    facing, behind = half @ out, np.einsum("nk,nk->n", half, to)
    inside = 1.0 - (1.0 - facing**2) / eta**2
    other = np.sqrt(np.maximum(inside, 0.0))
    along, across = (eta * facing - other) / (eta * facing + other), (facing - eta * other) / (facing + eta * other)
    reflected = np.where(inside > 0.0, (along**2 + across**2) / 2.0, 1.0)
    facets = alpha**2 / (np.pi * (half[:, 2] ** 2 * (alpha**2 - 1.0) + 1.0) ** 2)
    a, b = float(loss(np.array(out[2]), alpha)), loss(np.abs(to[:, 2]), alpha)
    beta = np.exp([math.lgamma(1 + a) + math.lgamma(1 + x) - math.lgamma(2 + a + x) for x in b])
    spread = eta**2 * np.abs(behind) / (facing + eta * behind) ** 2
    mirrored = reflected * facets / (4.0 * out[2] * (1.0 + a + b))
    refracted = np.where(behind < 0.0, (1.0 - reflected) * facets * facing * spread * beta / out[2], 0.0)
    return np.where(facing > 0.0, np.where(above[:, 0], mirrored, refracted), 0.0)


def bins_of(to: Float64) -> Any:
    """(n,) int, of both hemispheres."""
    ring = np.clip(((to[:, 2] + 1.0) * RINGS).astype(int), 0, 2 * RINGS - 1)
    sector = ((np.arctan2(to[:, 1], to[:, 0]) / (2 * np.pi) + 1.0) % 1.0 * SECTORS).astype(int)
    return ring * SECTORS + np.minimum(sector, SECTORS - 1)


@pytest.mark.parametrize("degrees", [10.0, 65.0])
@pytest.mark.parametrize("eta", [1.5, 1.0 / 1.5])
@pytest.mark.parametrize("roughness", [0.5, 0.95])
def test_light_that_meets_one_facet_is_drawn_with_its_density(roughness: float, eta: float, degrees: float) -> None:
    """Chi-square over both hemispheres at the 1e-6 level, as in test_scattering.py."""
    out = np.array([math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees))])
    to = walks(eta, roughness, np.tile(out.astype(np.float32), (COUNT, 1)), 1)
    counts = np.bincount(bins_of(to[to[:, 3] == 1.0]), minlength=2 * RINGS * SECTORS)
    z, turn = np.meshgrid(
        (np.arange(2 * RINGS * FINE) + 0.5) / (RINGS * FINE) - 1.0,
        (np.arange(SECTORS * FINE) + 0.5) * 2 * np.pi / (SECTORS * FINE), indexing="ij",
    )  # fmt: skip
    ring = np.sqrt(1.0 - z**2)
    grid = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=-1).reshape(-1, 3)
    density = of_one_facet(out, grid, eta, roughness**2)
    expected = np.bincount(bins_of(grid), density * 4 * np.pi / len(grid)) * COUNT
    used = expected > 20.0
    chi, freedom = float(((counts - expected) ** 2 / np.maximum(expected, 1e-9))[used].sum()), int(used.sum())
    assert chi < freedom + 6.0 * math.sqrt(2.0 * freedom)
    assert abs(counts[~used].sum() - expected[~used].sum()) < 5.0 * math.sqrt(expected[~used].sum() + 10.0)


def even_light(count: int, seed: int) -> Float32:
    """(n, 3) directions of light that is as bright from everywhere."""
    chance = np.random.default_rng(seed)
    square, turn = chance.random(count), 2 * np.pi * chance.random(count)
    ring = np.sqrt(square)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), np.maximum(np.sqrt(1 - square), 1e-3)], axis=1).astype(
        np.float32
    )


def pairs_of(out: Float32, to: Float64, *, through: bool) -> Any:
    """(r, r, t) counts of ways by the rings where they begin and end, equal in flux, and the turn about the normal."""
    rings, turns = 5, 3
    chosen = (to[:, 2] < 0.0) == through
    a, b = out[chosen].astype(np.float64), to[chosen]
    first, last = (np.minimum((c**2 * rings).astype(int), rings - 1) for c in (a[:, 2], b[:, 2]))
    turn = np.abs((np.arctan2(b[:, 1], b[:, 0]) - np.arctan2(a[:, 1], a[:, 0]) + np.pi) % (2 * np.pi) - np.pi)
    cell = (first * rings + last) * turns + np.minimum((turn / np.pi * turns).astype(int), turns - 1)
    return np.bincount(cell, minlength=rings * rings * turns).reshape(rings, rings, turns).astype(np.float64)


@pytest.mark.parametrize("roughness", [0.3, 1.0])
@pytest.mark.parametrize("eta", [1.5, 2.5])
def test_there_and_back_are_alike_over_any_number_of_facets(eta: float, roughness: float) -> None:
    """Reciprocity: f(o, i) = f(i, o) on one side, eta^2 f(o, i) = f(i, o) through the surface, so as many of even
    light's rays go from one ring to another as back; through, eta^2 times as many from the rarer side. Chi-square at
    the 1e-6 level."""
    out = even_light(COUNT, 5)
    there, back = walks(eta, roughness, out, 6), walks(1.0 / eta, roughness, out, 7)
    into, from_inside = pairs_of(out, there, through=True), pairs_of(out, back, through=True)
    over = np.swapaxes(from_inside, 0, 1) * eta**2
    used = (into > 20) & (over > 20)
    terms = [((into - over) ** 2 / np.maximum(into + eta**2 * over, 1.0))[used]]
    for same in (pairs_of(out, there, through=False), pairs_of(out, back, through=False)):
        upper = np.triu(np.ones(same.shape[:2], bool), 1)[..., None] & (same > 20)
        terms.append(((same - np.swapaxes(same, 0, 1)) ** 2 / (same + np.swapaxes(same, 0, 1) + 1e-9))[upper])
    chi = np.concatenate(terms)
    assert len(chi) > 60
    assert chi.sum() < len(chi) + 6.0 * math.sqrt(2.0 * len(chi))


@pytest.mark.parametrize("eta", [1.0, 1.02, 1.5, 3.0, 1.0 / 1.5, 1.0 / 3.0])
def test_walks_end_from_above_and_along_the_surface(eta: float) -> None:
    """Where the index is the same on both sides facets turn nothing: light goes straight on, through any number."""
    for roughness in (0.02, 0.3, 1.0):
        out = even_light(50_000, 8)
        out[:10_000] = math.sqrt(1.0 - 1e-6), 0.0, 1e-3
        to = walks(eta, roughness, out, 9)
        np.testing.assert_allclose(np.linalg.norm(to[:, :3], axis=1), 1.0, atol=1e-6)
        assert (to[:, 3] >= 1.0).all()
        if eta == 1.0:
            np.testing.assert_allclose(to[:, :3], -out, atol=1e-3)
        elif abs(eta - 1.0) > 0.1:
            assert (to[:, 3] < facet_walk.MOST_FACETS).all()


@pytest.mark.parametrize("roughness", [0.0, 0.4])
def test_glass_weighs_what_it_reflects_by_its_colour_and_what_it_lets_in_by_the_index_too(roughness: float) -> None:
    weights = np.zeros((4000, 2), np.float32)
    weighed(1.5, roughness, np.float32(0.5), np.random.default_rng(4).random((4000, 3), dtype=np.float32), weights)
    through = weights[:, 0] < 0.0
    assert 100 < through.sum() < 3900
    np.testing.assert_allclose(weights[through, 1], 0.5 / 1.5**2, rtol=1e-6)
    np.testing.assert_allclose(weights[~through, 1], 0.5, rtol=1e-6)
