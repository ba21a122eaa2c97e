"""A display that cannot be reached is refused before anything is rendered, with its panel and what was tried."""

from __future__ import annotations

import socket
from dataclasses import replace

import pytest

from wall.config.loading import loads
from wall.core.errors import RunError
from wall.display.x_server import check_displays
from wall.geometry.expanding import expand
from wall.geometry.panels import Panel

TEXT = """\
version: 1
scene: {source: x}
wall: {grid: {columns: 2, rows: 1, pixels: [8, 6], size: [0.8, 0.6]}}
views: [{camera: auto}]
"""


@pytest.fixture
def panel() -> Panel:
    return expand(loads(TEXT).config.wall).panels[0]


def on(panel: Panel, display: str) -> Panel:
    return replace(panel, config=panel.config.model_copy(update={"display": display}))


def test_display_that_nobody_serves_is_refused_with_the_sockets_that_were_tried(panel: Panel) -> None:
    with pytest.raises(RunError, match=r"panel r0c0: display :64999 cannot be reached \(tried /tmp/.X11-unix/X64999"):
        check_displays([on(panel, ":64999")])


def test_what_is_no_display_is_refused(panel: Panel) -> None:
    with pytest.raises(RunError, match="display 'left' is no X display; wanted one such as ':0'"):
        check_displays([on(panel, "left")])


def test_without_any_display_the_panel_is_named(panel: Panel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)

    with pytest.raises(RunError, match="panel r0c0: no X display to show it on"):
        check_displays([panel])


def test_display_of_a_machine_that_answers_is_accepted(panel: Panel) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        number = server.getsockname()[1] - 6000

        check_displays([on(panel, f"127.0.0.1:{number}.0")])
