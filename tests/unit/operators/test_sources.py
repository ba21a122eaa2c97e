"""`constant`, `image` and `mask`: colours and files in linear light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from framelets import applied, made, random_framelet, rect
from PIL import Image
from pydantic import ValidationError

from wall.core.colour import srgb_decoded
from wall.core.data import BLANK, Float32
from wall.core.errors import ConfigError
from wall.operators.mask import Mask
from wall.operators.sources import Constant, ImageSource

ROUNDING = 1e-6


def exr(path: Path, **channels: Float32) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: np.ascontiguousarray(values) for name, values in channels.items()}).write(str(path))


def test_a_constant_is_premultiplied_and_has_the_channels_that_it_names() -> None:
    out = applied(made(Constant, area=(2, 3, 4, 5), colour=(1.0, 2.0, 4.0), alpha=0.25, depth=7.0))
    assert out.rect == rect(2, 3, 4, 5)
    assert out.channels == {"colour", "alpha", "depth"}
    assert (out.colour == [0.25, 0.5, 1.0]).all()
    assert (out.channel("alpha") == 0.25).all()
    assert (out.channel("depth") == 7.0).all()
    assert applied(made(Constant, area=(0, 0, 1, 1), colour=(1.0, 1.0, 1.0))).channels == {"colour", "alpha"}


def test_a_png_is_decoded_and_premultiplied(tmp_path: Path, random_numbers: np.random.Generator) -> None:
    values = random_numbers.integers(0, 256, (4, 6, 4), np.uint8)
    Image.fromarray(values, "RGBA").save(tmp_path / "a.png")
    out = applied(made(ImageSource, area=(1, 2, 6, 4), file="a.png"), folder=tmp_path)
    alpha = values[..., 3:] / 255
    np.testing.assert_allclose(out.colour, srgb_decoded(values[..., :3] / 255) * alpha, atol=ROUNDING)
    np.testing.assert_allclose(out.channel("alpha"), alpha[..., 0], atol=ROUNDING)


def test_a_png_without_alpha_is_opaque(tmp_path: Path) -> None:
    Image.new("L", (3, 2), 255).save(tmp_path / "a.png")
    out = applied(made(ImageSource, area=(0, 0, 3, 2), file="a.png", depth=3.0), folder=tmp_path)
    assert (out.colour == 1.0).all()
    assert (out.channel("alpha") == 1.0).all()
    assert (out.channel("depth") == 3.0).all()


def test_an_exr_is_taken_as_it_is_with_its_depth(tmp_path: Path, random_numbers: np.random.Generator) -> None:
    names = ("R", "G", "B", "A", "Z")
    planes = {name: random_numbers.random((4, 6), np.float32) for name in names}
    exr(tmp_path / "a.exr", **planes)
    out = applied(made(ImageSource, area=(0, 0, 6, 4), file="a.exr", depth="file"), folder=tmp_path)
    np.testing.assert_array_equal(out.colour, np.stack([planes[name] for name in "RGB"], axis=-1))
    np.testing.assert_array_equal(out.channel("alpha"), planes["A"])
    np.testing.assert_array_equal(out.channel("depth"), planes["Z"])


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("none.png", "there is no such file"),
        ("a.gif", "cannot read '.gif', wanted .png or .exr"),
        ("text.png", "cannot be read as png"),
        ("text.exr", "cannot be read as exr"),
        ("cut.png", "cannot be read as png"),
        ("large.png", "is 9 x 5 pixels, wanted 6 x 4, the area of 'it'"),
        ("flat.exr", "has no channel Z"),
        ("uv.exr", "it has the channels U, V, not Y"),
    ],
)
def test_a_image_that_does_not_fit_is_refused(name: str, problem: str, tmp_path: Path) -> None:
    for text in ("text.png", "text.exr"):
        (tmp_path / text).write_text("no picture")
    Image.effect_noise((6, 4), 50).save(tmp_path / "whole.png")
    (tmp_path / "cut.png").write_bytes((tmp_path / "whole.png").read_bytes()[:60])
    Image.new("RGB", (9, 5)).save(tmp_path / "large.png")
    grey = np.zeros((4, 6), np.float32)
    exr(tmp_path / "flat.exr", Y=grey)
    exr(tmp_path / "uv.exr", U=grey, V=grey)
    with pytest.raises(ConfigError) as caught:
        made(ImageSource, area=(0, 0, 6, 4), file=name, depth="file").prepare(tmp_path, [])
    assert name in str(caught.value)
    assert problem in str(caught.value)


def test_a_source_needs_an_area_or_a_panel() -> None:
    for keys in ({}, {"area": (0, 0, 1, 1), "panel": "left"}):
        with pytest.raises(ValidationError):
            made(Constant, colour=(1.0, 1.0, 1.0), **keys)


@pytest.mark.parametrize("invert", [False, True])
def test_a_mask_of_an_area_leaves_nothing_beside_it(invert: bool, random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(1, 1, 8, 6))
    source.colour[0, 0] = np.nan  # outside the area
    out = applied(made(Mask, input="a", area=(3, 2, 4, 20), invert=invert), source)
    kept = np.zeros((6, 8), np.bool_)
    kept[1:, 2:6] = True
    kept ^= invert
    for name in out.channels:
        nothing = BLANK[name][0] if name in BLANK else 0.0
        values = out.channel(name)
        np.testing.assert_array_equal(values[kept], source.channel(name)[kept])
        assert (values[~kept] == nothing).all()


def test_a_mask_from_a_file_multiplies_by_its_luminance(tmp_path: Path, random_numbers: np.random.Generator) -> None:
    light = random_numbers.random((6, 8, 3), np.float32) * np.float32(1.4)
    exr(tmp_path / "a.exr", R=light[..., 0], G=light[..., 1], B=light[..., 2])
    source = random_framelet(random_numbers, rect(1, 1, 8, 6), channels=frozenset({"colour"}))
    out = applied(made(Mask, input="a", file="a.exr"), source, folder=tmp_path)
    kept = np.clip(light @ np.float32([0.2126, 0.7152, 0.0722]), 0.0, 1.0)
    np.testing.assert_allclose(out.colour, source.colour * kept[..., None], atol=ROUNDING)
    np.testing.assert_allclose(out.channel("alpha"), kept, atol=ROUNDING)


def test_a_mask_of_another_size_is_refused(tmp_path: Path) -> None:
    Image.new("L", (3, 2)).save(tmp_path / "a.png")
    with pytest.raises(ConfigError, match=r"a\.png is 3 x 2 pixels, wanted 4 x 4"):
        made(Mask, input="a", file="a.png").prepare(tmp_path, [rect(0, 0, 4, 4)])
