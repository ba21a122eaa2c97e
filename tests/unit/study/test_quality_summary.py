"""Summaries of planted rows: every expected number is worked out beside it."""

from __future__ import annotations

import json
import math
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wall.core.errors import ConfigError
from wall.study import json_lines
from wall.study.quality import rows as files
from wall.study.quality.image_strips import GAP, REFERENCE, image_path, moments
from wall.study.quality.plots import lines
from wall.study.quality.report import write_report
from wall.study.quality.requirements import verdicts
from wall.study.quality.rows import Row
from wall.study.quality.summary import best_other, compare, equal_error, interval, rate_for
from wall.study.quality.tables import equal_table, tables, write_summary

PROMISED = [
    "scene", "method", "rate", "width", "height", "seed", "clock", "rmse", "rmse_display", "flip", "ssim", "flicker",
    "latency_equivalent_ms", "bytes_per_s", "rays", "cpu_s",
]  # fmt: skip


def row(scene: str, method: str, error: float, *, rate: float = 4e5, seed: int = 1, flip: float | None = None) -> Row:
    return Row(
        scene=scene, method=method, rate=rate, width=256, height=256, seed=seed, clock="virtual", rmse=error,
        rmse_display=error, flip=error if flip is None else flip, ssim=0.9, flicker=0.01, latency_equivalent_ms=None,
        bytes_per_s=1e6, rays=1_600_000, cpu_s=1.0, secondary=0, cores=1.0, refresh_hz=60.0, seconds=4.0, shown=240,
        error_over_time=[error] * 3, times=[0.1, 0.2, 0.3], still_s=[0.0, 0.1, 0.2],
        reference="g", config="c.yaml", ablation="", commit="0",
        machine="m", command="wall",
    )  # fmt: skip


def test_rows_begin_with_the_promised_keys_in_order() -> None:
    assert [field.name for field in fields(Row)][: len(PROMISED)] == PROMISED
    assert list(json.loads(row("s", "a", 0.1).json_line()))[: len(PROMISED)] == PROMISED


def test_rows_survive_the_file_and_a_torn_last_line_is_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "new" / "quality.jsonl"
    first, second = row("a", "framed", 0.1), row("b", "framed", 0.2)
    json_lines.append(path, first)
    json_lines.append(path, second)
    assert files.read(path) == [first, second]
    path.write_text(path.read_text()[:-9])
    assert files.read(path) == [first]
    json_lines.append(path, second)
    assert files.read(path) == [first, second]


def test_line_that_is_no_row_is_refused_by_its_number(tmp_path: Path) -> None:
    path = tmp_path / "quality.jsonl"
    json_lines.append(path, row("a", "framed", 0.1))
    with path.open("a") as file:
        file.write('{"scene": "b"}\n')
    with pytest.raises(ConfigError, match=r"quality\.jsonl:2: not a row"):
        files.read(path)


def test_nan_becomes_null() -> None:
    assert json.loads(row("a", "framed", math.nan).json_line())["rmse"] is None


def test_newest_row_of_a_cell_counts() -> None:
    old, new = row("a", "framed", 0.1), row("a", "framed", 0.2)
    other = replace(old, seed=2)
    assert json_lines.newest([old, other, new]) == [new, other]


def test_ratio_is_the_geometric_mean_over_scenes_with_the_worst_named() -> None:
    rows = [row("a", "adaptive", 0.01), row("b", "adaptive", 0.02), row("a", "framed", 0.08), row("b", "framed", 0.04)]
    (found,) = compare(rows)
    assert (found.mean, found.worst, found.worst_scene) == (pytest.approx(4.0), pytest.approx(2.0), "b")
    assert found.low is None
    assert found.flip_higher


def test_scene_that_lacks_the_adaptive_method_is_left_out() -> None:
    rows = [row("a", "adaptive", 0.01), row("a", "framed", 0.08), row("b", "framed", 0.04)]
    assert [found.scenes for found in compare(rows)] == [1]


def test_flip_order_must_hold_on_every_scene() -> None:
    rows = [row("a", "adaptive", 0.01), row("b", "adaptive", 0.02, flip=0.5), row("a", "framed", 0.08)]
    rows.append(row("b", "framed", 0.04, flip=0.4))
    assert compare(rows)[0].flip_higher is False


def test_interval_over_seeds_is_students_of_the_logarithms() -> None:
    # logs 0 and 2: mean 1, standard error 1, t(1) = 12.706
    low, high = interval([1.0, math.e**2]) or (0.0, 0.0)
    assert (math.log(low), math.log(high)) == (pytest.approx(1 - 12.706), pytest.approx(1 + 12.706))
    assert interval([2.0]) is None


def test_seeds_give_an_interval_around_the_mean() -> None:
    rows = [row("a", m, e * (1 + 0.1 * s), seed=s) for m, e in (("adaptive", 0.01), ("framed", 0.04)) for s in (1, 2)]
    rows += [row("a", "framed", 0.05, seed=3), row("a", "adaptive", 0.01, seed=3)]
    (found,) = compare(rows)
    assert found.low is not None
    assert found.high is not None
    assert found.low < found.mean < found.high


def test_best_other_is_chosen_per_scene_without_tenfold_rays_and_ablations() -> None:
    errors = {"adaptive": (0.01, 0.01), "taa_half": (0.03, 0.06), "render_cache": (0.05, 0.02)}
    errors |= {"framed_x10": (0.011, 0.011), "adaptive:no_xyz": (0.011, 0.011), "framed": (0.1, 0.1)}
    rows = [row(scene, method, e) for method, pair in errors.items() for scene, e in zip("ab", pair, strict=True)]
    (found,) = best_other(rows)
    assert found.mean == pytest.approx(math.sqrt(3 * 2))
    assert found.worst_scene == "b (render_cache)"


def test_equal_error_rate_follows_a_power_law_exactly() -> None:
    # error = 40 / sqrt(rate): 0.02 needs 4 M/s, ten times 400 k/s
    curve = {rate: 40 / math.sqrt(rate) for rate in (1e5, 1e6, 1e7)}
    assert rate_for(curve, 0.02) == (pytest.approx(4e6), False)
    assert rate_for(curve, 0.004) == (pytest.approx(1e8), True)
    assert rate_for(curve, 0.4) == (pytest.approx(1e4), True)


def test_error_that_does_not_fall_with_the_rate_is_never_equal() -> None:
    assert rate_for({1e5: 0.1, 1e6: 0.1}, 0.05) == (math.inf, True)


def test_no_factor_is_told_that_is_far_from_what_was_measured() -> None:
    """Between two rates the error hardly falls, which says nothing of a rate a million times as high."""
    curve = [row("a", "framed", error, rate=rate) for rate, error in ((5e4, 0.123), (2e5, 0.112))]
    for error, told in ((0.05, "> 100"), (0.11, "1.3"), (0.2, "< 0.01")):
        (line,) = equal_table([*curve, row("a", "adaptive", error, rate=2e5)]).lines
        assert line[2:] == (told, "extrapolated")


def test_tenfold_rows_extend_the_framed_curve() -> None:
    rows = [row("a", "adaptive", 0.02), row("a", "framed", 40 / math.sqrt(4e5)), row("a", "framed_x10", 0.02)]
    (found,) = equal_error(rows)
    assert (found.factor, found.beyond) == (pytest.approx(10.0), False)


def test_bars_are_met_and_missed_by_the_figures() -> None:
    met = [row("a", "adaptive", 0.01), row("a", "framed", 0.061), row("a", "framed_x10", 0.026)]
    assert {v.what.split(",")[0]: v.met for v in verdicts(met)} == {
        "error of framed over adaptive": True,
        "error of framed_x10 over adaptive": True,
        "times faster framed must be for equal error": True,  # slope 0.37: 10^(log 6.1 / log 2.35) = 134
        "FLIP of framed": True,
    }
    missed = [row("a", "adaptive", 0.01), row("a", "framed", 0.059)]
    assert [v.met for v in verdicts(missed)] == [False, True]


def test_best_other_has_no_bar_until_all_rivals_ran() -> None:
    rows = [row("a", method, 0.02 if method == "adaptive" else 0.04) for method in ("adaptive", "taa_half", "afr2005")]
    assert not [v for v in verdicts(rows) if "best other" in v.what]
    rows += [row("a", method, 0.05) for method in ("render_cache", "reduced_64", "tapestry", "shading_cache")]
    (found,) = [v for v in verdicts(rows) if "best other" in v.what]
    assert found.met
    rows += [row("b", "adaptive", 0.01), row("b", "framed", 0.05)]
    assert not [v for v in verdicts(rows) if "best other" in v.what], "on scene b no rival ran"


def test_equal_cpu_time_has_bars_of_its_own() -> None:
    rows = [
        replace(row("a", method, e), clock="cpu")
        for method, e in (("adaptive", 0.01), ("framed", 0.021), ("taa_full", 0.012))
    ]
    assert [(v.what, v.met) for v in verdicts(rows)] == [
        ("error of framed over adaptive, 1 core", True),
        ("error of best TAA over adaptive, 1 core", False),
    ]


def test_noisy_light_has_bars_of_its_own_where_all_three_scenes_ran() -> None:
    errors = {"framed": 0.051, "accumulating": 0.049, "svgf_half": 0.03, "svgf": 0.019, "adaptive:no_filtering": 0.021}
    errors["adaptive"] = 0.01
    rows = [row(scene, method, e) for scene in ("bounce", "metal") for method, e in errors.items()]
    assert not [v for v in verdicts(rows) if "error of" in v.what], "two scenes have another mean"
    rows += [row("lamps", method, e) for method, e in (errors | {"svgf": 0.032}).items()]
    # the best of SVGF on each scene: 1.9, 1.9, 3.0
    assert {v.what.split(" over")[0]: (v.met, v.came) for v in verdicts(rows) if "noisy light, 400 k" in v.what} == {
        "error of framed": (True, "5.10, worst 5.10 (bounce)"),
        "error of accumulating": (False, "4.90, worst 4.90 (bounce)"),
        "error of best SVGF": (True, "2.21, worst 1.90 (bounce (svgf))"),
        "error of adaptive:no_filtering": (False, "2.10, worst 2.10 (bounce)"),
    }
    timed = [replace(row, clock="cpu") for row in rows]
    assert [(v.what, v.met) for v in verdicts(timed)] == [
        ("error of framed over adaptive, noisy light, 1 core", True),
        ("error of best SVGF over adaptive, noisy light, 1 core", True),
    ]


def test_summary_file_is_strict_json_even_where_a_number_does_not_exist(tmp_path: Path) -> None:
    rows = [row("a", "adaptive", 0.01), row("a", "framed", 0.05), row("a", "framed_x10", 0.06)]
    write_summary(tmp_path / "summary.json", rows)
    found = json.loads((tmp_path / "summary.json").read_text())
    assert found["equal_error"][0]["factor"] is None
    assert found["ratios"][0]["mean"] == pytest.approx(5.0)
    assert len(tables(rows)) == 3  # requirements are of the project's own scenes
    assert len(tables([replace(row, scene="orbit") for row in rows])) == 4
    assert tables([]) == []


def test_report_is_one_page_with_nothing_outside_it(tmp_path: Path) -> None:
    rows = [row(scene, method, e) for scene in ("a", "<b>") for method, e in (("adaptive", 0.01), ("framed", 0.06))]
    rows += [row("a", "taa_half", 0.03), row("a", "taa_full", 0.02), row("a", "adaptive:no_xyz", 0.02)]
    rng = np.random.default_rng(1)
    for method in (REFERENCE, "adaptive", "framed"):
        path = image_path(tmp_path, 0, scene="a", size=(256, 256), method=method, spent="400000")
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(rng.integers(0, 256, (8, 8, 3), np.uint8)).save(path)
    page = write_report(tmp_path, rows).read_text()
    assert not re.findall(r'(?:src|srcset|href)="(?!data:)', page)
    assert "<script" not in page
    assert "&lt;b&gt;" in page
    assert "6.0&times;" in page
    assert "Gain of each ingredient" in page
    assert sorted(p.name for p in (tmp_path / "plots").iterdir()) == [
        "error_against_bytes.png", "error_against_cpu.png", "error_against_rate.png", "error_over_time.png",
    ]  # fmt: skip
    (strip,) = (tmp_path / "strips").iterdir()
    assert Image.open(strip).size == (3 * (8 + GAP), 2 * 8 + GAP)


def test_plots_draw_a_family_as_its_best_method_on_each_scene() -> None:
    rows = [
        row("a", "taa_half", 0.03),
        row("a", "taa_full", 0.02),
        row("b", "taa_half", 0.01),
        row("b", "taa_full", 0.02),
    ]
    (line,) = lines(rows)
    assert (line.name, line.methods) == ("best TAA", {("a", 4e5): "taa_full", ("b", 4e5): "taa_half"})


def test_kept_image_says_how_far_it_is_off(tmp_path: Path) -> None:
    for method, value in ((REFERENCE, 0), ("adaptive", 51), ("framed", 102)):
        path = image_path(tmp_path, 1, scene="a", size=(256, 256), method=method, spent="400000")
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.full((4, 4, 3), value, np.uint8)).save(path)
    (moment,) = moments(tmp_path, [row("a", "adaptive", 0.01), row("a", "framed", 0.06)])
    assert [s.method for s in moment.shown] == ["adaptive", "framed"]
    assert [s.rmse for s in moment.shown] == pytest.approx([0.2, 0.4])
    assert [int(s.error.max()) for s in moment.shown] == [153, 255]


def test_image_at_rest_is_held_against_the_progressive_one_two_seconds_after_the_stop() -> None:
    rested = {"times": [1.0, 2.0, 3.0, 4.0], "still_s": [0.0, 0.0, 1.9, 2.1]}
    ours = replace(row("a", "adaptive", 0.02), error_over_time=[0.1, 0.1, 0.1, 0.01], **rested)
    other = replace(row("a", "progressive", 0.1), error_over_time=[0.1, 0.1, 0.01, 0.02], **rested)
    worse = replace(ours, seed=2, error_over_time=[0.1, 0.1, 0.1, 0.03])
    assert [(v.came, v.met) for v in verdicts([ours, other]) if "after a stop" in v.what] == [
        ("at worst 0.50 (0.0100 to 0.0200 in a)", True)
    ]
    found = verdicts([ours, other, worse, replace(other, seed=2)])
    assert [v.met for v in found if "after a stop" in v.what] == [False]
