"""What pages may choose to show: names of the run's folder and built-in scenes, and nothing else."""

from __future__ import annotations

import queue
import threading
from pathlib import Path

import pytest

import wall.run.choices
from wall.config.loading import load, loads, with_scene
from wall.core.errors import EditError
from wall.display.requests import Requests
from wall.roles.plan import Layout, make_layout
from wall.run.choices import AS_BEGUN, Choices, offer
from wall.scene.sources import BUILT_IN

HALL = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{path: {type: orbit, period_s: 9}}]
"""


def layout_in(folder: Path) -> Layout:
    (folder / "hall.yaml").write_text(HALL)
    (folder / "balls.yaml").write_text(HALL.replace("courtyard", "spheres"))
    (folder / "wider.yaml").write_text(HALL.replace("columns: 2", "columns: 3"))
    (folder / "broken.yaml").write_text("version: [")
    (folder / "notes.yaml").write_text("milk: 2")
    (folder / "chair.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "folder.yaml").mkdir()
    return make_layout(load(folder / "hall.yaml"))


def test_what_can_replace_the_configuration_as_it_runs_is_offered(tmp_path: Path) -> None:
    layout = layout_in(tmp_path)
    choices = Choices(layout)
    assert choices.names == ("balls.yaml", "hall.yaml", "chair.obj", *BUILT_IN)
    assert choices.shown == "hall.yaml"
    text, path = choices.load("balls.yaml")
    assert (text, path) == ((tmp_path / "balls.yaml").read_text(), str(tmp_path / "balls.yaml"))
    for name, source in (("chair.obj", str(tmp_path / "chair.obj")), ("gallery", "gallery")):
        text, path = choices.load(name)
        other = loads(text, path=Path(path))
        assert (other.config.scene.source, other.config.wall) == (source, layout.config.wall)
        assert Choices(make_layout(other), layout).shown == name


def test_a_wall_that_no_file_is_like_can_be_chosen_again(tmp_path: Path) -> None:
    begun = make_layout(with_scene(layout_in(tmp_path).loaded, "forest"))
    at_first = Choices(begun)
    assert (at_first.names[0], at_first.shown) == (AS_BEGUN, AS_BEGUN)
    text, path = at_first.load("gallery")
    later = Choices(make_layout(loads(text, path=Path(path))), begun)
    assert (later.names, later.shown) == (at_first.names, "gallery")
    text, path = later.load(AS_BEGUN)
    assert loads(text, path=Path(path)).config == begun.loaded.config


@pytest.mark.parametrize("name", ["wider.yaml", "../hall.yaml", "/etc/passwd", "", "folder.yaml", "hall"])
def test_no_other_file_can_be_named(tmp_path: Path, name: str) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "hall.yaml").write_text(HALL)
    choices = Choices(layout_in(tmp_path / "own"))
    with pytest.raises(EditError, match=r"is no choice; accepted: balls\.yaml, hall\.yaml, chair\.obj, "):
        choices.load(name)
    requests = Requests[str](loads=False)
    message = {"kind": "choose", "id": 7, "name": name}
    assert requests.chosen(message)[1] == "choose: want a `name`, where this wall offers any"
    requests.choices = choices
    assert "is no choice" in requests.chosen(message)[1]
    assert requests.why_not(message, 60, steers=False) == "this address lets watch, not change anything"
    chosen, refused = requests.chosen({**message, "name": "balls.yaml"})
    assert (chosen["kind"], chosen["path"], refused) == ("load", str(tmp_path / "own" / "balls.yaml"), "")


def test_a_file_that_is_gone_is_told(tmp_path: Path) -> None:
    choices = Choices(layout_in(tmp_path))
    (tmp_path / "balls.yaml").unlink()
    with pytest.raises(EditError, match=r"balls\.yaml: .*No such file"):
        choices.load("balls.yaml")


def test_what_is_found_late_of_an_earlier_layout_is_not_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    offered = queue.Queue[str]()

    class Page:
        def offer(self, choices: Choices) -> None:
            offered.put(choices.shown)

    earlier, later = layout_in(tmp_path), make_layout(load(tmp_path / "balls.yaml"))
    go_on, shown, page = threading.Event(), Choices._shown, Page()
    monkeypatch.setattr(
        Choices, "_shown", lambda own: shown(own) if own._layout is later or go_on.wait(10) else "never"
    )
    offer(page, earlier)  # type: ignore[arg-type]
    [looking] = [thread for thread in threading.enumerate() if thread.name == "choices"]
    offer(page, later)  # type: ignore[arg-type]
    assert offered.get(timeout=10) == "balls.yaml"
    go_on.set()
    looking.join(10)
    assert offered.empty()


def test_what_comes_to_the_folder_later_is_offered_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offered = queue.Queue[Choices]()

    class Page:
        def offer(self, choices: Choices) -> None:
            offered.put(choices)

    monkeypatch.setattr(wall.run.choices, "LOOK_S", 0.02)
    page, before = Page(), set(threading.enumerate())
    offer(page, layout_in(tmp_path))  # type: ignore[arg-type]
    [looking] = set(threading.enumerate()) - before
    assert "lamp.obj" not in offered.get(timeout=10).names
    (tmp_path / "lamp.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert "lamp.obj" in offered.get(timeout=10).names
    del page  # as a sink does when its run ends
    looking.join(10)
    assert not looking.is_alive()
