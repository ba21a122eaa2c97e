"""`blend_mask`: display values times those of an image, so that projectors' light sums to one image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from framelets import applied, assert_equal, made, random_framelet, rect
from PIL import Image

from wall.core.colour import srgb_encoded
from wall.core.data import Float64, Framelet
from wall.core.errors import ConfigError
from wall.operators.blend_mask import BlendMask

GAMMA, LIGHT = 2.2, [0.002, 0.18, 1.0]


def write(path: Path, values: Float64) -> None:
    """A PNG: grey of 16 bits, or RGB of 8."""
    if values.ndim == 2:
        Image.fromarray(np.round(values * 65535.0).astype(np.uint16)).save(path)
    else:
        Image.fromarray(np.round(values * 255.0).astype(np.uint8)).save(path)


def emitted(folder: Path, kept: Float64) -> Float64:
    """(h, w, 3) light of a projector that shows LIGHT everywhere through a mask."""
    write(folder / "m.png", kept)
    image = Framelet.blank(rect(3, 4, kept.shape[1], kept.shape[0]), frozenset())
    image.colour[...] = LIGHT
    shown = applied(made(BlendMask, input="a", file="m.png"), image, folder=folder)
    found: Float64 = srgb_encoded(shown.colour.astype(np.float64)) ** GAMMA
    return found


def test_light_through_masks_that_belong_together_sums_to_one_image(tmp_path: Path) -> None:
    """The error is that of 16 bits: of a mask value at most 1/131070, and of its light GAMMA times that."""
    share = np.tile(np.linspace(0.0, 1.0, 40), (3, 1))
    total = emitted(tmp_path, share ** (1 / GAMMA)) + emitted(tmp_path, (1 - share) ** (1 / GAMMA))
    alone = srgb_encoded(np.float64(LIGHT)) ** GAMMA
    np.testing.assert_allclose(total / alone, 1.0, atol=2 * GAMMA / 131070 + 2e-6)


def test_channels_have_factors_of_their_own(tmp_path: Path) -> None:
    kept = np.broadcast_to([1.0, 0.6, 0.0], (2, 5, 3))
    alone = srgb_encoded(np.float64(LIGHT)) ** GAMMA
    np.testing.assert_allclose(emitted(tmp_path, kept) / alone, kept**GAMMA, rtol=2e-5)


def test_white_changes_no_bit(tmp_path: Path, random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(5, -3, 7, 6), channels=frozenset({"colour", "depth"}))
    source.colour[2, 3] = np.inf
    write(tmp_path / "m.png", np.ones((6, 7)))
    assert_equal(applied(made(BlendMask, input="a", file="m.png"), source, folder=tmp_path), source)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("m.png", "is 4 x 3 pixels, wanted 5 x 3"),
        ("no.png", "there is no such file"),
        ("text.png", "cannot be read as"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, name: str, why: str) -> None:
    write(tmp_path / "m.png", np.ones((3, 4)))
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(ConfigError, match=why):
        made(BlendMask, input="a", file=name).prepare(tmp_path, [rect(0, 0, 5, 3)])
