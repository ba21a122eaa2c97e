import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from plan_rates import RATES

from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout, make_plan
from wall.study.plan import figures, report
from wall.study.plan import rates as files
from wall.study.plan.budget import Machines, acuity_of, budget_of, ways_of
from wall.study.plan.command import size_of
from wall.study.plan.target import READING_M, TEXTS, Given, of_numbers, of_plan

CONFIGS = Path(__file__).parents[3] / "configs"


def test_190_dpi_from_18_inches_are_one_pixel_a_minute_of_arc():
    acuity = acuity_of(TEXTS[1])
    assert acuity.minutes_a_pixel == pytest.approx(1.0, rel=0.01)  # 1 / (190 * 18) rad are 1.0051 minutes
    assert acuity.cycles_per_degree == pytest.approx(30.0, rel=0.01)
    assert acuity_of(replace(TEXTS[1], dpi=2 * 190.0)).cycles_per_degree == pytest.approx(60.0, rel=0.01)


def test_hyperacuity_of_the_printer_resolution_wall_takes_the_articles_165_gigapixels():
    assert acuity_of(TEXTS[2]).hyperacuity_pixels == pytest.approx(165e9, rel=0.02)


def test_printer_resolution_at_240_hz_is_nearly_2_terapixels_a_second():
    raw, jpeg, h264, frameless, adaptive = ways_of(TEXTS[2], RATES, Machines())
    assert raw.samples_per_s == pytest.approx(1.728e12)
    assert raw.bytes_per_s == pytest.approx(3 * 1.728e12)
    assert jpeg.bytes_per_s == pytest.approx(0.25 * 1.728e12)
    assert h264.coding_cores == pytest.approx(2e-8 * 1.728e12)
    assert adaptive.samples_per_s == pytest.approx(frameless.samples_per_s / 10)
    assert adaptive.links == pytest.approx(6.0 * 1.728e11 / 1.25e9, abs=1)


def test_two_of_pixels_size_and_dpi_give_the_third():
    wall = of_numbers(Given(pixels=8.0e6, dpi=100.0))
    again = of_numbers(Given(size=(wall.width_m, wall.height_m), dpi=100.0))
    assert again.pixels == pytest.approx(8.0e6)
    assert of_numbers(Given(pixels=8.0e6, size=(wall.width_m, wall.height_m))).dpi == pytest.approx(100.0)
    with pytest.raises(ConfigError, match="two of --pixels, --size and --dpi"):
        of_numbers(Given(pixels=8.0e6))
    with pytest.raises(ConfigError, match="--dpi 300"):
        of_numbers(Given(pixels=8.0e6, size=(wall.width_m, wall.height_m), dpi=300.0))
    with pytest.raises(ConfigError, match="--size 4by3"):
        size_of("4by3")


def test_a_configurations_wall_has_its_own_pixels_and_metres():
    target = of_plan(make_plan(make_layout(load(CONFIGS / "sampler_adaptive.yaml"))))
    assert (target.pixels, target.panels, target.refresh_hz) == (480 * 270, 1, 30.0)
    assert (target.width_m, target.height_m) == (pytest.approx(0.48), pytest.approx(0.27))
    assert target.dpi == pytest.approx(25.4)  # pixels of a millimetre


def test_hops_add_up_and_shrink_with_faster_machines():
    slow, fast = (budget_of(TEXTS[0], RATES, Machines(cores_a_rank=n, cores_a_compositor=n)) for n in (1.0, 64.0))
    assert slow.latency_s == pytest.approx(sum(hop.seconds for hop in slow.hops))
    assert fast.latency_s < slow.latency_s


def test_rates_are_read_as_they_were_written(tmp_path):
    files.save(tmp_path / "rates.json", RATES)
    assert files.load(tmp_path / "rates.json") == RATES
    (tmp_path / "rates.json").write_text(json.dumps(asdict(RATES) | {"batch_s": "fast"}), encoding="utf-8")
    with pytest.raises(ConfigError, match="batch_s is 'fast'; wanted a number"):
        files.load(tmp_path / "rates.json")


def test_a_report_is_one_page_that_loads_nothing_and_json(tmp_path):
    budgets = tuple(budget_of(target, RATES, Machines()) for target in TEXTS)
    found = report.Report(rates=RATES, machines=Machines(), budgets=budgets)
    data, page = report.write(found, tmp_path)
    html = page.read_text(encoding="utf-8")
    assert html.count("<svg") == 3
    assert "<script" not in html
    assert "src=" not in html
    assert figures.INK not in html  # figures take the page's ink
    values = json.loads(data.read_text(encoding="utf-8"))
    assert [row["target"]["pixels"] for row in values["budgets"]] == [455e6, 670e6, 7.2e9]
    assert values["budgets"][0]["latency_s"] == pytest.approx(budgets[0].latency_s, rel=1e-5)


def test_the_articles_walls_are_seen_from_reading_distance():
    assert {target.distance_m for target in TEXTS} == {READING_M}
