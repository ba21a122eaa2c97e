"""Panels to one image, and images to files."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wall.core.errors import LocalProtocolError, RunError
from wall.display.base import PanelImage, WallImage
from wall.display.png import BEZEL_RGB, PngSink, file_names, whole_wall, write_png


def wall_of(*panels: PanelImage, size: tuple[int, int]) -> WallImage:
    return WallImage(width=size[0], height=size[1], panels=panels, time=0.0, camera_event=0, scene_event=0)


def panel(rgb: np.ndarray, x: int, y: int, name: str = "p") -> PanelImage:
    return PanelImage(id=name, rgb=rgb, screen=(x, y), version=1)


def test_every_pixel_is_its_panels_or_the_bezels():
    rng = np.random.default_rng(4)
    a, b = (rng.integers(0, 256, (3, 4, 3), dtype=np.uint8) for _ in range(2))
    out = whole_wall(wall_of(panel(a, 0, 1), panel(b, 6, 0), size=(10, 4)))
    expected = np.empty((4, 10, 3), np.uint8)
    for y in range(4):
        for x in range(10):
            in_a, in_b = x < 4 and y >= 1, x >= 6 and y < 3
            expected[y, x] = a[y - 1, x] if in_a else b[y, x - 6] if in_b else BEZEL_RGB
    assert np.array_equal(out, expected)


def test_composing_leaves_the_panels_images_alone():
    rgb = np.full((2, 2, 3), 9, np.uint8)
    out = whole_wall(wall_of(panel(rgb, 0, 0), size=(2, 2)))
    out[:] = 0
    assert (rgb == 9).all()


@pytest.mark.parametrize("place", [(-1, 0), (0, -1), (3, 0), (0, 3)])
def test_panel_that_leaves_the_virtual_screen_is_named(place):
    image = wall_of(panel(np.zeros((2, 2, 3), np.uint8), *place, name="left"), size=(4, 4))
    with pytest.raises(LocalProtocolError, match=r"panel left: 2 x 2 pixels at .* 4 x 4"):
        whole_wall(image)


def test_files_hold_exactly_the_last_image(tmp_path, image, status):
    sink = PngSink(tmp_path / "deep" / "OUT")
    last = image(2, value=77)
    sink.show(image(1), status)
    sink.show(last, status)
    sink.close()
    files = {path.name: np.array(Image.open(path)) for path in (tmp_path / "deep" / "OUT").iterdir()}
    assert sorted(files) == ["panel-r0c0.png", "panel-r0c1.png", "wall.png"]
    assert np.array_equal(files["wall.png"], whole_wall(last))
    assert np.array_equal(files["panel-r0c1.png"], last.panels[1].rgb)


def test_files_are_written_while_images_are_shown(tmp_path, image, status):
    sink = PngSink(tmp_path, every_s=0.01)
    sink.show(image(1), status)
    limit = time.monotonic() + 30.0
    while not (tmp_path / "panel-r0c1.png").exists():
        assert time.monotonic() < limit
        time.sleep(0.01)
    (tmp_path / "wall.png").unlink()
    sink.close()
    assert not (tmp_path / "wall.png").exists(), "the same image is not written again"


def test_images_that_cannot_be_written_are_counted_and_told_once(tmp_path, image, status, capsys):
    sink = PngSink(tmp_path, every_s=0.01)
    (tmp_path / "wall.png").mkdir()
    sink.show(image(1), status)
    limit = time.monotonic() + 30.0
    while sink.dropped().get("png_unwritten", 0) < 3:
        assert time.monotonic() < limit
        time.sleep(0.01)
    (tmp_path / "wall.png").rmdir()
    sink.close()
    assert (tmp_path / "wall.png").is_file()
    said = capsys.readouterr().err
    assert said.count(f"warning: cannot write {tmp_path / 'wall.png'}: ") == 1
    assert "tried again" in said


def test_nothing_shown_writes_nothing(tmp_path):
    PngSink(tmp_path).close()
    assert list(tmp_path.iterdir()) == []


def test_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "wall.png"
    write_png(path, np.zeros((4, 4, 3), np.uint8))
    held = path.open("rb")  # a reader of the old image keeps all of it
    write_png(path, np.full((4, 4, 3), 255, np.uint8))
    with held:
        assert (np.array(Image.open(held)) == 0).all()
    assert (np.array(Image.open(path)) == 255).all()
    assert [p.name for p in tmp_path.iterdir()] == ["wall.png"]


def test_failed_write_leaves_no_part_behind(tmp_path):
    target = tmp_path / "wall.png"
    (target / "in the way").mkdir(parents=True)
    with pytest.raises(RunError, match=r"cannot write .*wall\.png: "):
        write_png(target, np.zeros((2, 2, 3), np.uint8))
    assert [p.name for p in tmp_path.iterdir()] == ["wall.png"]


def test_folder_that_cannot_be_made_is_refused_before_the_run(tmp_path):
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(RunError, match=r"cannot create the folder .*file/OUT: Not a directory"):
        PngSink(blocker / "OUT")


def test_file_names_cannot_leave_the_folder_and_all_differ():
    names = file_names(["a", "../../etc", "A", "a/b", "a_b", "", "x" * 300, "ä"])
    assert names[:2] == ["panel-a.png", "panel-.._.._etc.png"]
    assert len({name.lower() for name in names}) == 8
    assert all(Path(name).name == name and len(name) < 80 for name in names)
