"""Deep zoom: the pixels are those of the whole image resized, however it is cut up; what is missing is coarser."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from PIL import Image

from wall.commands.tiles import cut_up, format_of
from wall.core.data import Framelet, Rect
from wall.core.errors import ConfigError
from wall.operators import deep_zoom
from wall.operators.deep_zoom import DeepZoom, ZoomedImage
from wall.operators.pyramid import Codes, Shape, TileKey, open_pyramid, read_descriptor

SIZE = (700, 500)
AREA = (320, 200)
ONE_TO_ONE = float(np.log2(500 / 200))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """photo.png, smooth but for some noise, and photo.dzi with tiles of PNG."""
    made = tmp_path_factory.mktemp("deep_zoom")
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    waves = 127.5 + 100.0 * np.stack([np.sin(x / 37), np.cos(y / 23), np.sin((x + y) / 51)], -1)
    noise = np.random.default_rng(5).normal(0.0, 4.0, waves.shape)
    Image.fromarray(np.clip(waves + noise, 0, 255).astype(np.uint8)).save(made / "photo.png")
    cut_up(made / "photo.png", made / "photo.dzi", "png", lambda done, total: None)
    return made


def settled(view: ZoomedImage, values: Mapping[str, float] | None = None) -> Codes:
    """Its pixels once all tiles are there."""
    limit = time.monotonic() + 20.0
    view.follow(values or {})
    codes = view.codes()
    while view.waits:
        assert time.monotonic() < limit, view.failures
        time.sleep(0.001)
        codes = view.codes()
    return codes


def looking(path: Path, x: float, y: float, zoom: float, size: tuple[int, int] = AREA) -> Codes:
    return settled(ZoomedImage(open_pyramid(path), size, (x, y, zoom)))


def test_pixel_for_pixel_it_is_the_image(folder: Path) -> None:
    image = np.asarray(Image.open(folder / "photo.png").convert("RGBA"))
    assert_array_equal(looking(folder / "photo.png", 0.5, 0.5, 0.0, SIZE), image)
    zoom = ONE_TO_ONE  # of an area that shows a part, from a whole pixel on
    shown = looking(folder / "photo.dzi", 300 / 700, 200 / 500, zoom)
    assert_array_equal(shown, image[100:300, 140:460])


@pytest.mark.parametrize("zoom", [-3.0, -0.4, 0.0, 0.7, 1.1, 1.5, 4.0, 9.0])
@pytest.mark.parametrize(("x", "y"), [(0.5, 0.5), (0.31, 0.62), (0.0, 1.0)])
def test_tiles_show_what_the_whole_image_shows(folder: Path, x: float, y: float, zoom: float) -> None:
    assert_array_equal(looking(folder / "photo.dzi", x, y, zoom), looking(folder / "photo.png", x, y, zoom))


@pytest.mark.parametrize("zoom", [-1.3, -0.4, 0.0, 0.7, 1.0, 2.5, 5.0])
def test_smooth_images_are_those_of_one_resize(folder: Path, zoom: float) -> None:
    """Levels are means of 2x2 pixels, then a triangle filter: within 3 codes of Pillow's on waves of 140 pixels."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    waves = np.stack([np.sin(x / 37), np.cos(y / 23), np.sin((x + y) / 51)], -1)
    Image.fromarray((127.5 + 127.0 * waves + 0.5).astype(np.uint8)).save(folder / "smooth.png")
    shown = looking(folder / "smooth.png", 0.4, 0.6, zoom)
    scale = 2.0**zoom * min(AREA[0] / SIZE[0], AREA[1] / SIZE[1])
    left, top = 0.4 * SIZE[0] - 0.5 * AREA[0] / scale, 0.6 * SIZE[1] - 0.5 * AREA[1] / scale
    columns, rows = ((np.arange(n) + 0.5) / scale + at for n, at in ((AREA[0], left), (AREA[1], top)))
    inside = np.ix_(
        np.flatnonzero((rows > 1.0 / scale) & (rows < SIZE[1] - 1.0 / scale)),
        np.flatnonzero((columns > 1.0 / scale) & (columns < SIZE[0] - 1.0 / scale)),
    )
    u, v = columns[inside[1].ravel()] - 0.5, rows[inside[0].ravel()] - 0.5
    exact = 127.5 + 127.0 * np.stack(
        np.broadcast_arrays(np.sin(u / 37), np.cos(v[:, None] / 23), np.sin((u + v[:, None]) / 51)), -1
    )
    assert np.abs(shown[inside][..., :3] - exact).max() <= 3.0
    assert not shown[rows < 0.0].any()


def test_where_it_is_transparent_colours_are_those_of_alpha_times_light_within_two_codes(tmp_path: Path) -> None:
    """Pillow multiplies by alpha, filters and divides again, in whole codes."""
    codes = np.full((100, 160, 4), 200, np.uint8)
    codes[..., 3] = np.linspace(60, 255, 160)
    Image.fromarray(codes, "RGBA").save(tmp_path / "a.png")
    shown = looking(tmp_path / "a.png", 0.5, 0.5, 0.0).astype(int)
    assert np.abs(shown[..., :3] - 200).max() <= 2
    assert np.abs(shown[..., 3] - np.linspace(60, 255, 320)).max() <= 2


def test_beyond_the_image_nothing_is_there(folder: Path) -> None:
    shown = looking(folder / "photo.dzi", 0.0, 0.0, -1.0)
    assert not shown[:100, :160].any()
    assert shown[101:, 161:, 3].any()


def test_while_tiles_are_read_coarser_ones_are_shown(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pyramid = open_pyramid(folder / "photo.dzi")
    view = ZoomedImage(pyramid, AREA, (0.5, 0.5, 0.0))
    whole = settled(view)
    held, known = pyramid._read, set(view._tiles)
    pyramid._read = lambda key: held((0, 0, 0)) if key[0] == pyramid.shape.top else held(key)  # of a wrong size
    at_once = settled(view, {"zoom": 2.0})
    assert {key[0] for key in set(view._tiles) - known} <= set(range(pyramid.shape.top))
    assert view.failures
    assert all("of level 10 has 1 x 1 pixels" in why for why in view.failures)
    assert (settled(view, {"zoom": 2.001}) != 0).any(), "it is not tried again at once"
    pyramid._read = held
    monkeypatch.setattr(deep_zoom, "RETRY_S", 0.0)
    exact = looking(folder / "photo.dzi", 0.5, 0.5, 2.0)
    assert np.sqrt(((at_once.astype(float) - exact) ** 2).mean()) < 8.0, "blurred, but the same picture"
    assert_array_equal(settled(view, {"zoom": 2.0, "x": 0.5001}), looking(folder / "photo.dzi", 0.5001, 0.5, 2.0))
    assert view.failures == ()
    assert_array_equal(settled(view), whole)


def test_memory_is_bounded_and_what_was_forgotten_is_read_again(folder: Path) -> None:
    view = ZoomedImage(open_pyramid(folder / "photo.dzi"), AREA, (0.1, 0.1, 2.0))
    view._most_bytes = 600_000
    first = settled(view)
    for k in range(20):  # tiles come while pixels are made
        view.follow({"x": 0.05 * k, "y": 0.9, "zoom": 1.0 + 0.1 * k})
        view.codes()
        time.sleep(0.002)
    settled(view, {"x": 0.9, "y": 0.9})
    assert view._bytes == sum(codes.nbytes for codes in view._tiles.values())
    assert view._bytes <= max(600_000, sum(view._tiles[key].nbytes for key in view._needed if key in view._tiles))
    assert_array_equal(settled(view, {}), first)


def test_an_area_that_needs_more_than_the_budget_settles_all_the_same(folder: Path) -> None:
    view = ZoomedImage(open_pyramid(folder / "photo.dzi"), AREA, (0.5, 0.5, 1.0))
    view._most_bytes = 1000
    assert_array_equal(settled(view), looking(folder / "photo.png", 0.5, 0.5, 1.0))


@pytest.mark.parametrize("area", [(31, 31), (1, 1), (400, 3)])
@pytest.mark.parametrize("zoom", [-8.0, 26.0])
def test_the_ends_of_its_range_show_something(folder: Path, area: tuple[int, int], zoom: float) -> None:
    assert looking(folder / "photo.dzi", 0.3, 0.4, zoom, area).shape == (area[1], area[0], 4)


def test_any_error_of_a_tile_leaves_the_others(folder: Path) -> None:
    pyramid = open_pyramid(folder / "photo.dzi")
    view, read = ZoomedImage(pyramid, AREA, (0.5, 0.5, 1.0)), pyramid._read

    def without_memory(key: TileKey) -> Codes:
        if key == (10, 1, 1):
            raise MemoryError
        return read(key)

    pyramid._read = without_memory
    assert settled(view).any()
    assert view.failures == ("MemoryError",)


def test_what_is_closed_reads_no_more(folder: Path) -> None:
    pyramid = open_pyramid(folder / "photo.dzi")
    read, begun = pyramid._read, []

    def slowly(key: TileKey) -> Codes:
        begun.append(key)
        time.sleep(0.05)
        return read(key)

    pyramid._read = slowly
    view = ZoomedImage(pyramid, AREA, (0.5, 0.5, 1.0))
    view.codes()
    view.close()
    time.sleep(0.2)
    assert len(begun) <= 2
    assert not view._pending


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_grey_images_of_16_bits_keep_their_ramp(suffix: str, tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(0, 65535, 256).astype(np.uint16), (8, 1))
    Image.fromarray(ramp).save(tmp_path / f"a.{suffix}")
    shown = looking(tmp_path / f"a.{suffix}", 0.5, 0.5, 0.0, (256, 8))
    assert_array_equal(shown[..., :3], np.repeat((ramp >> 8)[..., None], 3, axis=2))


def test_regions_are_parts_of_the_whole(folder: Path) -> None:
    node = DeepZoom(op="deep_zoom", id="photo", area=(10, 20, *AREA), file="photo.png", zoom=1.0)
    rect, prepared = node.rect([]), node.prepare(folder, [])
    settled(prepared)
    whole, parts = (Framelet.blank(rect, frozenset({"colour", "alpha"})) for _ in range(2))
    node.apply([], whole, rect, prepared)
    for x in range(10, 330, 64):
        node.apply([], parts, Rect(x=x, y=20, width=min(64, 330 - x), height=200), prepared)
    assert_array_equal(parts.colour, whole.colour)
    assert whole.alpha is not None
    assert whole.colour.max() <= whole.alpha.max(), "light times alpha"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<Image", "no Deep Zoom Image"),
        ('<Image TileSize="256" Overlap="0" Format="png"/>', "names no Size"),
        ('<Image TileSize="0" Overlap="0" Format="png"><Size Width="9" Height="9"/></Image>', "TileSize 0"),
        ('<Image TileSize="9" Overlap="9" Format="png"><Size Width="9" Height="9"/></Image>', "less overlap"),
        ('<Image TileSize="9" Overlap="0" Format="../x"><Size Width="9" Height="9"/></Image>', "Format '../x'"),
        ('<Image TileSize="9" Overlap="0" Format="png"><Size Width="0" Height="9"/></Image>', "0 x 9 pixels"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><Image/>', "declares entities"),
        ('<Image TileSize="9" Overlap="0" Format="png"><Size Width="9" Height="9"/></Image>', "no such tile"),
    ],
)
def test_what_is_no_deep_zoom_image_is_refused_with_its_name(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "a.dzi").write_text(text)
    with pytest.raises(ConfigError, match=says) as refused:
        open_pyramid(tmp_path / "a.dzi")
    assert str(tmp_path / "a") in str(refused.value)


def test_a_folder_of_another_image_is_refused(folder: Path, tmp_path: Path) -> None:
    text = (folder / "photo.dzi").read_text()
    (tmp_path / "photo_files").symlink_to(folder / "photo_files")
    for width in (9000, 500):
        (tmp_path / "photo.dzi").write_text(text.replace('Width="700"', f'Width="{width}"'))
        with pytest.raises(ConfigError, match=r"no such tile|has .* pixels, wanted"):
            open_pyramid(tmp_path / "photo.dzi")


def test_tiles_that_overlap_are_cut_to_their_own_pixels(folder: Path, tmp_path: Path) -> None:
    image = Image.open(folder / "photo.png")
    (tmp_path / "a.dzi").write_text(
        '<Image xmlns="http://schemas.microsoft.com/deepzoom/2008" TileSize="254" Overlap="1" Format="png">'
        '<Size Width="700" Height="500"/></Image>'
    )
    shape, _ = read_descriptor(tmp_path / "a.dzi")
    for level in range(shape.top + 1):
        width, height = shape.size(level)
        smaller = image if level == shape.top else image.resize((width, height), Image.Resampling.BOX)
        (tmp_path / "a_files" / str(level)).mkdir(parents=True)
        for _, column, row in shape.tiles(level, (0, 0, width, height)):
            x, y = column * 254, row * 254
            box = (max(x - 1, 0), max(y - 1, 0), min(x + 255, width), min(y + 255, height))
            smaller.crop(box).save(tmp_path / "a_files" / str(level) / f"{column}_{row}.png")
    shown = looking(tmp_path / "a.dzi", 300 / 700, 200 / 500, ONE_TO_ONE)
    assert_array_equal(shown[..., :3], np.asarray(image)[100:300, 140:460])


@pytest.mark.parametrize("size", [(1, 1), (1, 700), (257, 256), (513, 3)])
def test_every_size_is_cut_up_to_one_pixel(size: tuple[int, int], tmp_path: Path) -> None:
    codes = np.random.default_rng(1).integers(0, 256, (size[1], size[0], 3), np.uint8)
    Image.fromarray(codes).save(tmp_path / "a.png")
    shape = cut_up(tmp_path / "a.png", tmp_path / "a.dzi", "png", lambda done, total: None)
    assert shape == Shape(*size, 256)
    assert shape.size(0) == (1, 1)
    found = open_pyramid(tmp_path / "a.dzi")
    for level in range(shape.top + 1):
        for key in shape.tiles(level, (0, 0, *shape.size(level))):
            found.tile(key)
    assert_array_equal(looking(tmp_path / "a.dzi", 0.5, 0.5, 0.0, size)[..., :3], codes)


def test_nothing_is_overwritten_and_nothing_half_done_stays(folder: Path, tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(ConfigError, match=r"photo\.dzi: is there already"):
        cut_up(folder / "photo.png", folder / "photo.dzi", "png", lambda done, total: None)
    with pytest.raises(KeyboardInterrupt):
        cut_up(folder / "photo.png", tmp_path / "a.dzi", "jpg", stop)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ConfigError, match=r"ends in \.dzi"):
        cut_up(folder / "photo.png", tmp_path / "a.xml", "jpg", stop)
    with pytest.raises(ConfigError, match="no such file"):
        cut_up(tmp_path / "b.png", tmp_path / "a.dzi", "jpg", stop)
    with pytest.raises(ConfigError, match="--format gif; wanted jpg or png"):
        format_of("gif")
