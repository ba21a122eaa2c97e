"""The list of what else the wall can show: hidden where it offers nothing, and why a choice was refused."""

from __future__ import annotations

import pytest
from page_input import eventually

from wall.config.loading import load
from wall.display.base import Answer
from wall.roles.plan import make_layout
from wall.run.choices import Choices

pytestmark = pytest.mark.browser
HALL = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{path: {type: orbit, period_s: 9}}]
"""


def test_a_choice_is_sent_as_its_file_and_a_refusal_told(page, source, tmp_path):
    assert page.locator("#choices").is_hidden()
    for name, scene in (("hall.yaml", "courtyard"), ("balls.yaml", "spheres")):
        (tmp_path / name).write_text(HALL.replace("courtyard", scene))
    source.sink.offer(Choices(make_layout(load(tmp_path / "hall.yaml"))))
    page.wait_for_selector("#choices:not([hidden])")
    scenes = page.get_by_label("Scene")
    assert scenes.input_value() == "hall.yaml"
    assert scenes.locator("option").all_inner_texts()[:4] == ["balls.yaml", "hall.yaml", "arcade", "cornell"]

    scenes.select_option("balls.yaml")
    eventually(page, lambda: [c for c in source.received if c["kind"] == "load"], "the choice")
    asked = source.received[-1]
    assert (asked["text"], asked["path"]) == (HALL.replace("courtyard", "spheres"), str(tmp_path / "balls.yaml"))
    assert (page.inner_text("#choice-words"), scenes.is_disabled()) == ("Loading balls.yaml", True)
    source.sink.answer(asked["id"], Answer(refused="rank 1: no memory"))
    page.wait_for_function("() => document.getElementById('choice-words').textContent.endsWith('no memory')")
    assert page.inner_text("#choice-words") == "balls.yaml: refused. rank 1: no memory"
    assert (scenes.input_value(), scenes.is_disabled()) == ("hall.yaml", False)
    page.keyboard.press("z")
    eventually(page, lambda: source.received[-1]["kind"] == "undo", "keys are the wall's again")

    scenes.select_option("spheres")
    eventually(page, lambda: source.received[-1]["kind"] == "load" and source.received[-1] is not asked, "another one")
    source.sink.answer(source.received[-1]["id"], Answer(edit=3))
    page.wait_for_function("() => document.getElementById('choice-words').hidden")


def test_the_list_works_by_keys_and_shows_what_was_chosen(page, source, tmp_path):
    """Its keys steer nothing. What is shown may be said before the answer comes."""
    for name, scene in (("hall.yaml", "courtyard"), ("yard.yaml", "spheres")):
        (tmp_path / name).write_text(HALL.replace("courtyard", scene))
    source.sink.offer(Choices(make_layout(load(tmp_path / "hall.yaml"))))
    page.wait_for_selector("#choices:not([hidden])")
    scenes = page.get_by_label("Scene")
    scenes.focus()
    page.keyboard.press("ArrowDown")
    eventually(page, lambda: [c for c in source.received if c["kind"] == "load"], "the choice")
    assert {c["kind"] for c in source.received} == {"load"}
    asked = source.received[-1]
    assert asked["path"] == str(tmp_path / "yard.yaml")
    (tmp_path / "zoo.yaml").write_text(HALL)
    source.sink.offer(Choices(make_layout(load(tmp_path / "yard.yaml"))))
    page.wait_for_selector("#choice-list option[value='zoo.yaml']", state="attached")
    assert scenes.input_value() == "yard.yaml"
    source.sink.answer(asked["id"], Answer(edit=3))
    page.wait_for_function("() => document.getElementById('choice-words').hidden")
    assert (scenes.input_value(), scenes.is_disabled()) == ("yard.yaml", False)
