"""`denoise` with Open Image Denoise itself."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from framelets import applied, made, random_framelet, rect

from wall.core.data import Framelet
from wall.core.errors import ConfigError, RunError
from wall.operators.denoise import Denoise

DENOISE = made(Denoise, input="a")


def test_noise_becomes_less_and_the_image_stays(random_numbers: np.random.Generator) -> None:
    """A ramp up to 4 under noise of 20 %: at least three quarters of the error go, and other channels stay."""
    source = random_framelet(random_numbers, rect(0, 0, 96, 64), channels=frozenset({"depth", "variance"}))
    ideal = np.repeat(np.linspace(0.1, 4.0, 96, dtype=np.float32)[None, :, None], 64, axis=0).repeat(3, axis=2)
    source.colour[...] = ideal * (1 + 0.2 * random_numbers.standard_normal(ideal.shape, np.float32))
    out = applied(DENOISE, source)
    before, after = (np.sqrt(((values - ideal) ** 2).mean()) for values in (source.colour, out.colour))
    assert after < before / 4
    np.testing.assert_array_equal(out.channel("depth"), source.channel("depth"))
    assert "variance" not in out.channels


def test_without_the_package_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(ConfigError, match=r"denoise 'it'.*pip install 'pyoidn>=2\.5'"):
        DENOISE.prepare(Path(), [])


def test_a_failure_of_the_library_names_the_node() -> None:
    def failing(*_: object, **__: object) -> np.ndarray:
        raise RuntimeError("OIDN filter execution failed (error 4): out of memory")

    source = Framelet.blank(rect(0, 0, 4, 4), frozenset())
    with pytest.raises(RunError, match=r"denoise 'it': .*out of memory"):
        DENOISE.apply([source], Framelet.blank(source.rect, frozenset()), source.rect, failing)


def test_albedos_and_normals_keep_what_noise_would_hide(random_numbers: np.random.Generator) -> None:
    """Stripes of albedo, two pixels wide, in light with noise of 100 %: by colour alone they are hardly seen."""
    source = random_framelet(random_numbers, rect(0, 0, 96, 96), channels=frozenset({"albedo", "normal"}))
    stripes = np.where(np.arange(96) // 2 % 2 == 0, 0.3, 0.6).astype(np.float32)
    source.channel("albedo")[...], source.channel("normal")[...] = stripes[None, :, None], (0.0, 0.0, 1.0)
    source.colour[...] = source.channel("albedo") * random_numbers.exponential(1.0, (96, 96, 1)).astype(np.float32)
    alone = Framelet(rect=source.rect, colour=source.colour)
    by_colour, informed = (applied(DENOISE, framelet).colour - stripes[None, :, None] for framelet in (alone, source))
    assert np.sqrt((informed**2).mean()) < 0.5 * np.sqrt((by_colour**2).mean())


def test_surfaces_that_no_sample_described_are_not_taken_for_black_ones(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 32, 32), channels=frozenset({"albedo", "normal"}))
    source.channel("albedo")[...] = source.channel("normal")[...] = 0.0
    alone = Framelet(rect=source.rect, colour=source.colour)
    np.testing.assert_array_equal(applied(DENOISE, source).colour, applied(DENOISE, alone).colour)
