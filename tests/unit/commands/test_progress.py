"""What a start says of the page: its address in one line, opened where no other user can read it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from wall.commands import progress

HOST = "http://head-of-the-wall.visualisation.department.example.org:8800/"


@pytest.mark.parametrize(("address", "opened"), [(HOST, [HOST]), (f"{HOST}?token=abcdefghijklmnopqrstuv", [])])
def test_an_address_stays_whole_and_one_with_a_token_is_on_no_command_line(
    address: str, opened: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: list[str] = []
    monkeypatch.setenv("DISPLAY", ":9")
    monkeypatch.setattr("webbrowser.open", seen.append)
    start = progress.StartProgress(open_page=True)
    start.opened(address)
    start.say(f"note: to watch the wall without steering it: {address}")
    said = capsys.readouterr()
    assert seen == opened
    assert address in said.out
    assert address in said.err


def test_the_end_of_a_run_says_that_images_in_its_folder_are_of_an_older_one(tmp_path: Path) -> None:
    assert progress._without_images(tmp_path, 5.0) == " (no images)"
    (tmp_path / "panel-a.png").touch()
    assert progress._without_images(tmp_path, 5.0) == ""
    os.utime(tmp_path / "panel-a.png", (1e9, 1e9))
    assert "older run" in progress._without_images(tmp_path, 5.0)


def test_a_measurement_tells_how_far_it_is_where_no_bar_can_be_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first, the last, and what comes LINE_S after the one before."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress.measuring("") as update:
        for done in (1, 2, 3, 4, 5):
            update(description=f"orbit {done}", completed=done, total=5)
            now[0] += 0.6 * progress.LINE_S
    assert capsys.readouterr().err.splitlines() == ["1 of 5: orbit 1", "3 of 5: orbit 3", "5 of 5: orbit 5"]
