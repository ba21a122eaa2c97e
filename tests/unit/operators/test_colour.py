"""`colour` and its tables: formulas, bounds of the interpolation, and files that are refused at their line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from framelets import applied, made, random_framelet, rect

from wall.core.colour import srgb_decoded, srgb_encoded
from wall.core.data import Float32, Float64, Framelet
from wall.core.errors import ConfigError
from wall.operators.colour import Colour
from wall.operators.lut import Lut, read_lut

ROUNDING = 1e-6


def table_of(function: Callable[[Float64], Float64], n: int, low: float = 0.0, high: float = 1.0) -> Lut:
    """A table of a function of (..., 3) colours."""
    nodes = np.linspace(low, high, n)
    blue, green, red = np.meshgrid(nodes, nodes, nodes, indexing="ij")
    values = function(np.stack([red, green, blue], axis=-1)).astype(np.float32)
    return Lut(values, np.full(3, low, np.float32), np.full(3, high, np.float32))


def cube(folder: Path, function: Callable[[Float64], Float64], n: int) -> str:
    rows = table_of(function, n).table.reshape(-1, 3)
    (folder / "a.cube").write_text("\n".join([f"LUT_3D_SIZE {n}", *(" ".join(map(str, row)) for row in rows)]))
    return "a.cube"


def test_gain_then_opacity_scale_light_alpha_and_variance(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 5, 4))
    out = applied(made(Colour, input="a", gain=2.0, opacity=0.25), source)
    np.testing.assert_array_equal(out.colour, source.colour * np.float32(0.5))
    np.testing.assert_array_equal(out.channel("alpha"), source.channel("alpha") * np.float32(0.25))
    np.testing.assert_array_equal(out.channel("variance"), source.channel("variance") * np.float32(0.25))
    np.testing.assert_array_equal(out.channel("depth"), source.channel("depth"))


def test_opacity_gives_alpha_to_an_opaque_image() -> None:
    out = applied(made(Colour, input="a", opacity=0.25), Framelet.blank(rect(0, 0, 2, 1), frozenset()))
    assert out.channel("alpha").tolist() == [[0.25, 0.25]]


def test_gamma_is_an_exponent_of_the_colour_without_alpha(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 9, 8))
    out = applied(made(Colour, input="a", gain=(0.5, 1.0, 2.0), gamma=2.2), source)
    alpha = source.channel("alpha")[..., None].astype(np.float64)
    plain = np.divide(source.colour, alpha, out=np.zeros(source.colour.shape), where=alpha > 0)
    np.testing.assert_allclose(out.colour, plain**2.2 * [0.5, 1.0, 2.0] * alpha, atol=ROUNDING)
    assert "variance" not in out.channels


def test_an_identity_table_changes_nothing(tmp_path: Path, random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 9, 8), channels=frozenset({"colour"}))
    for interpolation in ("tetrahedral", "trilinear"):
        operator = made(Colour, input="a", lut=cube(tmp_path, lambda c: c, 5), interpolation=interpolation)
        np.testing.assert_allclose(applied(operator, source, folder=tmp_path).colour, source.colour, atol=ROUNDING)


def test_the_table_works_on_display_values(tmp_path: Path) -> None:
    source = Framelet.blank(rect(0, 0, 1, 1), frozenset())
    source.colour[...] = srgb_decoded(np.float32([0.75, 0.5, 0.25]))
    out = applied(made(Colour, input="a", lut=cube(tmp_path, lambda c: 1 - c, 2)), source, folder=tmp_path)
    np.testing.assert_allclose(srgb_encoded(out.colour[0, 0]), [0.25, 0.5, 0.75], atol=ROUNDING)


@pytest.mark.parametrize("tetrahedral", [False, True])
def test_linear_functions_are_exact(tetrahedral: bool, random_numbers: np.random.Generator) -> None:
    matrix = random_numbers.random((3, 3))
    colours = random_numbers.random((200, 3), np.float32)
    got = table_of(lambda c: c @ matrix - 0.3, 4)(colours, tetrahedral=tetrahedral)
    np.testing.assert_allclose(got, colours @ matrix - 0.3, atol=ROUNDING)


@pytest.mark.parametrize("tetrahedral", [False, True])
def test_curved_functions_stay_within_the_stated_bound_and_come_near_it(
    tetrahedral: bool, random_numbers: np.random.Generator
) -> None:
    """|c|^2 has the Hessian 2 I. Halfway in every axis both interpolations are off by 3 h^2 / 4, the bound itself."""

    def curved(c: Float64) -> Float64:
        return np.repeat((c**2).sum(axis=-1, keepdims=True), 3, axis=-1)

    n = 5
    bound = 3.0 / 8.0 * 2.0 / (n - 1) ** 2
    colours = random_numbers.random((4000, 3), np.float32)
    colours[0] = 0.5 / (n - 1)
    off = np.abs(table_of(curved, n)(colours, tetrahedral=tetrahedral) - curved(colours.astype(np.float64)))
    assert off.max() <= bound + ROUNDING
    assert off[0, 0] == pytest.approx(bound, rel=1e-4)


def test_tetrahedral_keeps_greys_on_the_line_between_grey_nodes(random_numbers: np.random.Generator) -> None:
    table = table_of(lambda c: c**3, 3)
    table.table[0, 0, 1] = 9.0  # a red node beside the grey line
    grey = np.repeat(random_numbers.random((50, 1), np.float32), 3, axis=1)
    nodes = np.float64([0, 0.5, 1])
    np.testing.assert_allclose(table(grey)[:, 1], np.interp(grey[:, 0], nodes, nodes**3), atol=ROUNDING)
    assert np.abs(table(grey, tetrahedral=False)[:, 1] - np.interp(grey[:, 0], nodes, nodes**3)).max() > 0.5


@pytest.mark.parametrize("tetrahedral", [False, True])
def test_colours_beside_the_table_are_clipped(tetrahedral: bool) -> None:
    table = table_of(lambda c: c, 3, low=-1.0, high=3.0)
    odd = np.float32([[-7.0, 9.0, np.inf], [np.nan, -np.inf, 3.0]])
    assert table(odd, tetrahedral=tetrahedral).tolist() == [[-1.0, 3.0, 3.0], [-1.0, -1.0, 3.0]]


def written(folder: Path, text: str) -> Path:
    (folder / "a.cube").write_text(text)
    return folder / "a.cube"


def rows(n: int) -> str:
    return "0 0.5 1\n" * n


def test_comments_titles_and_domains_are_read(tmp_path: Path) -> None:
    text = f'# made by hand\nTITLE "warm"\n\nDOMAIN_MIN -1 0 0 # here\nDOMAIN_MAX 2 1 1e1\nLUT_3D_SIZE 2\n{rows(8)}'
    found = read_lut(written(tmp_path, text))
    assert found.table.shape == (2, 2, 2, 3)
    assert (found.low.tolist(), found.high.tolist()) == ([-1.0, 0.0, 0.0], [2.0, 1.0, 10.0])


def test_red_varies_fastest(tmp_path: Path) -> None:
    numbered = "".join(f"{k} 0 0\n" for k in range(8))
    found = read_lut(written(tmp_path, f"LUT_3D_SIZE 2\n{numbered}"))
    corners: Float32 = np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    assert found(corners)[:, 0].tolist() == [1.0, 2.0, 4.0]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "no LUT_3D_SIZE"),
        ("\n\nLUT_3D_SIZE 1\n", ":3: LUT_3D_SIZE 1, wanted one number, 2 to 256"),
        ("LUT_3D_SIZE 2 2\n", ":1: LUT_3D_SIZE 2 2, wanted one number"),
        ("LUT_3D_SIZE 9999999999\n", ":1: LUT_3D_SIZE 9999999999, wanted one number"),
        ("LUT_1D_SIZE 16\n", ":1: LUT_1D_SIZE, wanted a 3D table"),
        ("LUT_3D_SIZE 2\nFOO 1\n", ":2: FOO, wanted LUT_3D_SIZE"),
        ("0 0 0\nLUT_3D_SIZE 2\n", ":1: a colour before LUT_3D_SIZE"),
        ("LUT_3D_SIZE 2\n0 0 0\nTITLE x\n", ":3: TITLE after the first colour"),
        (f"LUT_3D_SIZE 2\n{rows(7)}", ":8: ends after 7 colours, wanted 2^3 = 8"),
        (f"LUT_3D_SIZE 2\n{rows(9)}", ":10: more colours than the 2^3 = 8"),
        ("LUT_3D_SIZE 2\n0 0\n", ":2: '0 0', wanted 3 numbers"),
        ("LUT_3D_SIZE 2\n0 0 x\n", ":2: '0 0 x', wanted 3 numbers"),
        ("LUT_3D_SIZE 2\n0 0 1e999\n", ":2: '0 0 1e999', wanted 3 numbers"),
        ("LUT_3D_SIZE 2\n0 0 1e31\n", ":2: '0 0 1e31', wanted 3 numbers"),
        ("LUT_3D_SIZE 2\nnan 0 0\n", ":2: nan, wanted LUT_3D_SIZE"),
        ("\0\0\x1f\x8b", ":1: a colour before LUT_3D_SIZE"),
        (f"LUT_3D_SIZE 2\nDOMAIN_MIN 0 0 1\n{rows(8)}", "DOMAIN_MAX [1.0, 1.0, 1.0] is not above DOMAIN_MIN"),
    ],
)
def test_a_wrong_table_is_refused_at_its_line(text: str, problem: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        read_lut(path)
    assert str(caught.value).startswith(f"{path}")
    assert problem in str(caught.value)


def test_a_missing_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.cube: cannot be read"):
        made(Colour, input="a", lut="none.cube").prepare(tmp_path, [])
