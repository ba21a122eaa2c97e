"""`wall measure response`: which image is the first that shows an edit, and what is edited."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from running import write_config

from wall.config.loading import load
from wall.config.sampling import ProgressiveSampling
from wall.core.errors import EditError
from wall.display.image_log import LoggedImages, LoggedPanel
from wall.roles.plan import make_layout, make_plan
from wall.study.live.response import edited_parameter, follows, waits, without_rests

SIZE = (20, 10)
BYTES = 3 * SIZE[0] * SIZE[1]


def log(*shown: tuple[float, str, int, int]) -> LoggedImages:
    """Images of a panel at a time, of a scene event, all of one code."""
    panels = tuple(
        LoggedPanel(
            time=time, refresh=time, panel=panel, version=k, screen=(0, 0), size=SIZE, offset=k * BYTES,
            camera_event=0, scene_event=event, scene_time=0.0,
        )
        for k, (time, panel, event, _) in enumerate(shown)
    )  # fmt: skip
    pixels = np.repeat(np.array([code for *_, code in shown], np.uint8), BYTES)
    return LoggedImages(began=0.0, display_delay_s=0.0, panels=panels, cpu_s=0.0, pixels=pixels)


def test_an_edit_is_shown_by_the_first_image_of_any_panel_that_goes_its_way() -> None:
    images = log(
        (1.0, "a", 0, 100), (1.0, "b", 0, 50), (2.1, "a", 1, 100), (2.2, "b", 1, 40), (2.3, "a", 1, 80),
        (3.1, "a", 2, 70), (3.5, "a", 2, 100), (9.0, "b", 9, 10),
    )  # fmt: skip
    assert waits(images, [2.0, 3.0, 4.0]) == [pytest.approx(0.2), pytest.approx(0.5), None]


def test_noise_goes_both_ways_and_is_no_answer() -> None:
    """40,000 pixels of noise: the difference of its two ways has a sigma of 200, and 6 of them are wanted."""
    random = np.random.default_rng(5)
    before = random.integers(100, 110, (200, 200, 3)).astype(np.uint8)
    after = random.integers(100, 110, (200, 200, 3)).astype(np.uint8)
    assert not follows(after, before, darker=True)
    assert not follows(after, before, darker=False)
    after[:60] -= 50
    assert follows(after, before, darker=True)
    assert not follows(after, before, darker=False)


def test_a_light_is_edited_and_nothing_else_can_be(tmp_path: Path) -> None:
    plan = make_plan(make_layout(load(write_config(tmp_path))))
    assert edited_parameter(plan, "").name == "lights.0.intensity"
    assert edited_parameter(plan, "sky.strength").default == (1.0,)
    for name in ("exposure", "materials.mosaic.color"):
        with pytest.raises(EditError, match="no light that could be halved"):
            edited_parameter(plan, name)


def test_the_progressive_method_is_measured_without_rests(tmp_path: Path) -> None:
    loaded = load(write_config(tmp_path, threads=2))
    sampling = without_rests(loaded, "progressive").config.sampling_of(0)
    assert isinstance(sampling, ProgressiveSampling)
    assert (sampling.rest_s, sampling.threads) == (0.0, 2)
    assert without_rests(loaded, "adaptive") is loaded
