"""`warp`: positions found again, images moved, meshes refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from framelets import applied, assert_equal, made, random_framelet, rect
from pydantic import ValidationError

from wall.core.data import BLANK, Float64, Framelet
from wall.core.errors import ConfigError
from wall.operators.kernels.resample import NOWHERE, SUBPIXELS
from wall.operators.warp import Mesh, Warp, WarpTables

POSITION_ERROR = 0.5 / SUBPIXELS * 1.5  # pixels: half a step, and the meshes here stretch by less than 1.5


def grid(columns: int, rows: int) -> Float64:
    """(rows, columns, 2) nodes of the mesh that changes nothing."""
    return np.stack(np.meshgrid(np.arange(columns) / (columns - 1), np.arange(rows) / (rows - 1)), axis=-1)


def warp(nodes: Float64) -> Warp:
    mesh = {"columns": nodes.shape[1], "rows": nodes.shape[0], "points": nodes.reshape(-1, 2).tolist()}
    operator = made(Warp, input="a", mesh=mesh)
    assert isinstance(operator, Warp)
    return operator


def forward(nodes: Float64, u: Float64, v: Float64) -> Float64:
    """(n, 2) where positions (u, v) of the image, 0..1, go: bilinear between the nodes around."""
    rows, columns = nodes.shape[0] - 1, nodes.shape[1] - 1
    i, j = np.minimum((v * rows).astype(int), rows - 1), np.minimum((u * columns).astype(int), columns - 1)
    f, g = (v * rows - i)[:, None], (u * columns - j)[:, None]
    top = nodes[i, j] * (1 - g) + nodes[i, j + 1] * g
    bottom = nodes[i + 1, j] * (1 - g) + nodes[i + 1, j + 1] * g
    return top * (1 - f) + bottom * f


@pytest.mark.parametrize("nodes", [grid(2, 2), grid(3, 5), grid(8, 4)])
def test_the_mesh_that_changes_nothing_changes_no_bit(nodes: Float64, random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(5, -3, 37, 23))
    source.colour[3, 4] = np.nan
    source.colour[7, 9] = np.inf
    assert_equal(applied(warp(nodes), source), source)


@pytest.mark.parametrize("seed", range(4))
def test_each_place_goes_to_the_pixel_that_shows_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes = grid(4, 3) * 0.9 + 0.05 + rng.uniform(-0.03, 0.03, (3, 4, 2))
    width, height = 60, 40
    operator = warp(nodes)
    assert operator.mesh is not None
    positions = WarpTables(operator.mesh).table(rect(0, 0, width, height))
    y, x = np.nonzero(positions[..., 0] != NOWHERE)
    assert 0.7 < len(x) / (width * height) < 1.0
    at = positions[y, x] / SUBPIXELS + 0.5
    u, v = np.clip(at[:, 0] / width, 0, 1), np.clip(at[:, 1] / height, 0, 1)
    reached = forward(nodes, u, v) * (width, height)
    np.testing.assert_allclose(reached, np.stack([x + 0.5, y + 0.5], axis=-1), atol=POSITION_ERROR)


def test_pixels_are_mixed_of_the_four_around_their_place() -> None:
    source = Framelet.blank(rect(0, 0, 8, 4), frozenset({"variance", "object_id"}))
    source.colour[...] = np.arange(8)[:, None]
    source.channel("variance")[...] = 1.0
    source.channel("object_id")[...] = np.arange(8)
    out = applied(warp(grid(2, 2) - [0.5 / 8, 0.0]), source)  # half a pixel to the left
    assert out.colour[1, :, 0].tolist() == [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.0]
    assert out.channel("variance")[1].tolist() == [0.5] * 7 + [1.0]
    assert out.channel("object_id")[1].tolist() == [1, 2, 3, 4, 5, 6, 7, 7]


def test_what_the_mesh_does_not_reach_is_blank(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 8, 8))
    out = applied(warp(grid(2, 2) * 0.5), source)
    for name in out.channels:
        nothing = BLANK[name][0] if name in BLANK else 0.0
        assert (out.channel(name)[4:] == nothing).all()
        assert (out.channel(name)[:, 4:] == nothing).all()


def test_a_mesh_may_mirror(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 8, 6))
    out = applied(warp(grid(2, 2)[:, ::-1]), source)
    np.testing.assert_array_equal(out.colour, source.colour[:, ::-1])


def test_a_mesh_in_a_file_is_that_mesh(tmp_path: Path, random_numbers: np.random.Generator) -> None:
    (tmp_path / "mesh.yaml").write_text(
        "columns: 2\nrows: 2\npoints:\n  - [0.1, 0.0]\n  - [1.0, 0.1]\n  - [0.0, 0.9]\n  - [0.8, 1.0]\n"
    )
    (tmp_path / "mesh.json").write_text('{"columns": 2, "rows": 2, "points": [[0.1, 0], [1, 0.1], [0, 0.9], [0.8, 1]]}')
    source = random_framelet(random_numbers, rect(0, 0, 8, 6))
    nodes = np.float64([[[0.1, 0.0], [1.0, 0.1]], [[0.0, 0.9], [0.8, 1.0]]])
    for name in ("mesh.yaml", "mesh.json"):
        operator = made(Warp, input="a", file=name)
        assert_equal(applied(operator, source, folder=tmp_path), applied(warp(nodes), source))
        assert operator.touched(rect(2, 2, 1, 1), [source.rect], 0) == source.rect


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (None, "cannot be read"),
        ("columns: 2\nrows: [\n", "mesh.yaml:3: "),
        ("columns: 2\nrows: 2\npoints: [[0, 0]]\n", "mesh.yaml: points: "),
        ("columns: 2\nrows: 3\npoints: [[0, 0], [1, 0], [0, 1], [1, 1]]\n", "4 points for 2 x 3 nodes"),
        ("7", "mesh.yaml: the mesh: "),
        (b"\xff\xfe\x00", "is not text"),
    ],
)
def test_a_wrong_file_is_refused(text: str | bytes | None, problem: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "mesh.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigError) as caught:
        made(Warp, input="a", file="mesh.yaml").prepare(tmp_path, [])
    assert problem in str(caught.value)


def test_a_warp_needs_a_mesh_or_a_file() -> None:
    mesh = Mesh(columns=2, rows=2, points=((0, 0), (1, 0), (0, 1), (1, 1)))
    for keys in ({}, {"mesh": mesh, "file": "mesh.yaml"}):
        with pytest.raises(ValidationError):
            made(Warp, input="a", **keys)


def table(folder: Path, shares: Float64) -> Warp:
    np.save(folder / "table.npy", shares.astype(np.float32))
    operator = made(Warp, input="a", file="table.npy")
    assert isinstance(operator, Warp)
    return operator


def centres(width: int, height: int) -> Float64:
    """(h, w, 2) shares of the image: the centre of each pixel."""
    return np.stack(np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height), axis=-1)


def test_a_table_of_each_pixel_s_own_position_changes_no_bit(
    tmp_path: Path, random_numbers: np.random.Generator
) -> None:
    source = random_framelet(random_numbers, rect(5, -3, 37, 23))
    source.colour[3, 4] = np.nan
    assert_equal(applied(table(tmp_path, centres(37, 23)), source, folder=tmp_path), source)


def test_a_table_shows_what_a_mesh_of_the_same_shape_shows(tmp_path: Path, random_numbers: np.random.Generator) -> None:
    """Both know positions to half a step; the image changes by at most 1 from pixel to pixel."""
    source = random_framelet(random_numbers, rect(0, 0, 40, 30))
    source.colour[...] = random_numbers.random((30, 40, 3), np.float32)
    nodes = grid(2, 2) * [0.8, 0.9] + [0.1, 0.05]
    shares = (centres(40, 30) - [0.1, 0.05]) / [0.8, 0.9]
    shares[(np.abs(shares - 0.5) > 0.5).any(axis=2)] = np.nan
    by_mesh, by_table = applied(warp(nodes), source), applied(table(tmp_path, shares), source, folder=tmp_path)
    assert np.abs(by_mesh.colour - by_table.colour).max() <= 4 / SUBPIXELS


def test_pixels_without_a_position_are_blank(tmp_path: Path) -> None:
    source = Framelet.blank(rect(0, 0, 4, 3), frozenset({"colour", "alpha"}))
    source.colour[...], source.channel("alpha")[...] = 1.0, 1.0
    shares = centres(4, 3)
    shares[1, 2] = np.nan
    shown = applied(table(tmp_path, shares), source, folder=tmp_path)
    assert (shown.colour == 1.0).all(axis=2).sum() == 11
    assert shown.channel("alpha")[1, 2] == 0.0


@pytest.mark.parametrize(
    ("written", "why"),
    [
        (np.zeros((3, 5, 2), np.float32), r"is \(3, 5, 2\) of float32, wanted \(3, 4, 2\) floating-point"),
        (np.zeros((3, 4, 2), np.int64), "of int64"),
        (np.array([None]), "no .npy file that can be read"),
        (np.zeros((300, 400, 2)), "more than"),
    ],
)
def test_a_table_of_another_shape_is_refused(tmp_path: Path, written: np.ndarray, why: str) -> None:
    np.save(tmp_path / "table.npy", written, allow_pickle=True)
    with pytest.raises(ConfigError, match=why):
        made(Warp, input="a", file="table.npy").prepare(tmp_path, [rect(0, 0, 4, 3)])
