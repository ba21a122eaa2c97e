"""After a jump: which image comes first follows from what rays cost here, then each is twice as fine, to the last."""

from __future__ import annotations

import pytest

from wall.config.screens import GridConfig, WallConfig
from wall.geometry.expanding import expand
from wall.geometry.panels import Panel
from wall.roles.refinement import FIRST_PERIODS, LONGEST_S, REMEMBERED_S, Cost, Refinement

PERIOD_S, BATCH = 1.0 / 30.0, 2048


def panel_of(width: int, height: int) -> Panel:
    return expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(width, height), size=(1.0, 0.5)))).panels[0]


def refinement_where(ray_s: float, *, pixels: tuple[int, int] = (480, 270)) -> Refinement:
    """Of a machine where a ray takes so long, and nothing else takes time."""
    refinement, now = Refinement(panel_of(*pixels), PERIOD_S), 0.0
    for _ in range(round(20 * REMEMBERED_S / (BATCH * ray_s))):
        refinement.traced(BATCH, now, now + BATCH * ray_s, swept=False)
        refinement.refreshed(1, 0.0)
        now += BATCH * ray_s
    return refinement


def sweep(refinement: Refinement) -> int:
    """Trace a sweep to its end. Returns its rays."""
    count = 0
    while not refinement.swept:
        rays = len(refinement.take(BATCH))
        count += rays
        refinement.traced(rays, 0.0, 0.0, swept=True)
    return count


@pytest.mark.parametrize(("ray_s", "scale"), [(1e-7, 1), (1e-6, 2), (4e-6, 4), (1.2e-5, 8), (1e-3, 8)])
def test_the_first_image_has_as_many_pixels_as_a_refresh_interval_pays_for(ray_s: float, scale: int) -> None:
    refinement = refinement_where(ray_s)

    assert refinement.begin(1) == refinement.scale == scale
    assert refinement.active
    assert refinement.first
    pays_for = FIRST_PERIODS * PERIOD_S / ray_s
    assert scale == 8 or 480 * 270 / scale**2 <= 1.2 * pays_for


@pytest.mark.parametrize(("cores", "scale"), [(2.0, 2), (1.0, 2), (0.05, 8)])
def test_where_nothing_was_measured_a_process_reckons_with_its_share_of_the_cores(cores: float, scale: int) -> None:
    assert Refinement(panel_of(480, 270), PERIOD_S, cores).begin(1) == scale


def test_others_who_take_the_cores_between_batches_make_rays_dear() -> None:
    alone, beside = Refinement(panel_of(480, 270), PERIOD_S), Refinement(panel_of(480, 270), PERIOD_S)
    for k in range(200):
        alone.traced(BATCH, 0.002 * k, 0.002 * k + 0.001, swept=False)
        alone.refreshed(1, 0.001)
        beside.traced(BATCH, 0.03 * k, 0.03 * k + 0.001, swept=False)

    assert (alone.begin(1), beside.begin(1)) == (2, 8)


def test_each_image_is_twice_as_fine_and_the_sampler_fills_the_finest() -> None:
    refinement, rays, scales = refinement_where(1.2e-5 / 4, pixels=(480, 270)), [], []
    assert refinement.begin(1) == 4
    while refinement.active:
        rays.append(sweep(refinement))
        scales.append(refinement.scale)
        refinement.shown(still=True)

    assert scales == [4, 2]
    assert refinement.scale == 1
    assert sum(rays) == pytest.approx(240 * 135, rel=1e-2)
    assert len(refinement.take(BATCH)) == 0


def test_what_takes_too_long_is_left_to_the_sampler() -> None:
    ray_s = 1.5 * LONGEST_S / (480 * 270)
    refinement = refinement_where(ray_s)
    refinement.begin(1)
    sweep(refinement)
    while refinement.active and refinement.scale > 2:
        refinement.shown(still=True)
        sweep(refinement)

    refinement.shown(still=True)

    assert (refinement.scale, refinement.active) == (2, False)


def test_a_sweep_goes_on_through_refreshes_and_ends_where_the_camera_moves() -> None:
    refinement = refinement_where(1.2e-5)
    refinement.begin(1)
    taken = len(refinement.take(1000))
    refinement.traced(taken, 0.0, 0.0, swept=True)
    refinement.shown(still=True)
    assert (refinement.active, refinement.first, refinement.swept, refinement.scale) == (True, False, False, 8)

    refinement.shown(still=False)

    assert not refinement.active
    assert len(refinement.take(BATCH)) == 0


def test_a_cost_is_of_what_was_spent_lately_whatever_the_steps() -> None:
    even, uneven = Cost(1.0), Cost(1.0)
    for k in range(1000):
        even.add(10, 0.01)
        uneven.add(10, 0.1 if k % 10 == 0 else 0.0)

    assert even.each == pytest.approx(0.001, rel=1e-3)
    assert uneven.each == pytest.approx(0.001, rel=0.1)
