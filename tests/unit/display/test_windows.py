"""Native windows, seen by real screenshots of X servers without a screen; keys pressed through their XTEST."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shown_panels import looks_like, noise, on_black, panels, shown, window
from x_servers import comes_true, press, screenshot, x_server
from Xlib import XK, X
from Xlib.display import Display

from wall.config.screens import PanelConfig, WallConfig
from wall.core.errors import LocalProtocolError, RunError
from wall.display.tiles import changed_since, tile_rects, updated
from wall.display.window import WindowSink
from wall.display.window_host import MOST_RECTS
from wall.geometry.expanding import expand

RGB = NDArray[np.uint8]
SETTLED_S = 20.0


@pytest.fixture(scope="module")
def screens() -> Iterator[tuple[str, str]]:
    """Two screens of one X server: 300 x 200 and 120 x 90 pixels."""
    with x_server("300x200", "120x90") as name:
        yield f"{name}.0", f"{name}.1"


def test_two_windows_on_one_screen_show_exactly_what_was_put(screens: tuple[str, str]) -> None:
    two = panels((97, 61), (50, 33), display=screens[0], window=[window(10, 20, 97, 61), window(150, 100, 50, 33)])
    first, second = noise(97, 61), noise(50, 33, 2)
    sink = WindowSink(two, refresh_hz=60)
    try:
        sink.put([shown(two[0], first), shown(two[1], second)])
        assert sink.settled(SETTLED_S)
        assert looks_like(screens[0], on_black(300, 200, (10, 20, first), (150, 100, second)))
        newer = noise(97, 61, 3)
        sink.put([shown(two[0], newer, 2), shown(two[1], second)])
        assert sink.settled(SETTLED_S)
        assert looks_like(screens[0], on_black(300, 200, (10, 20, newer), (150, 100, second)))
        assert (sink.notes, sink.finished) == ((), "")
    finally:
        sink.close()


def test_a_panel_without_a_window_fills_the_screen_that_it_names(screens: tuple[str, str]) -> None:
    [one] = panels((120, 90), display=screens[1])
    sink = WindowSink([one], refresh_hz=60)
    try:
        sink.put([shown(one, noise(120, 90))])
        assert looks_like(screens[1], noise(120, 90))
    finally:
        sink.close()


def test_panels_on_two_x_servers_are_shown_by_one_sink(screens: tuple[str, str]) -> None:
    with x_server("64x48") as other:
        two = panels((120, 90), (64, 48), display=[screens[1], other])
        sink = WindowSink(two, refresh_hz=60)
        try:
            sink.put([shown(two[0], noise(120, 90)), shown(two[1], noise(64, 48, 2))])
            assert looks_like(screens[1], noise(120, 90))
            assert looks_like(other, noise(64, 48, 2))
        finally:
            sink.close()


@pytest.mark.parametrize("rotation", [90, 180, 270])
def test_a_turned_display_is_sent_the_image_turned_back(screens: tuple[str, str], rotation: int) -> None:
    size = (90, 120) if rotation % 180 else (120, 90)
    [one] = panels(size, display=screens[1], rotation=rotation)
    rgb = noise(*size)
    as_mounted = np.rot90(rgb, rotation // 90)  # counterclockwise, so that a clockwise mount shows it upright
    sink = WindowSink([one], refresh_hz=60)
    try:
        sink.put([shown(one, rgb)])
        assert looks_like(screens[1], as_mounted)
        assert sink.notes == ()
    finally:
        sink.close()


def stereo(at: float = 0.0, **changes: Any) -> PanelConfig:
    """A panel of 60 x 45 pixels for each eye, side by side, 1.2 m wide."""
    corners = {"lower_left": (at, 0, 0), "lower_right": (at + 1.2, 0, 0), "upper_left": (at, 0.9, 0)}
    plain = {"id": f"p{at}", "pixels": (120, 45), "corners": corners, "stereo": "side_by_side"}
    return PanelConfig.model_validate(plain | changes)


@pytest.mark.parametrize("named", ["a window", "a monitor", "nothing"])
def test_both_eyes_of_a_panel_share_its_window(screens: tuple[str, str], named: str) -> None:
    display, place = {
        "a window": (screens[0], {"window": window(30, 20, 120, 45)}),
        "a monitor": (screens[1], {"pixels": (120, 90), "monitor": 0}),
        "nothing": (screens[1], {"pixels": (120, 90)}),
    }[named]
    halves = expand(WallConfig(panels=(stereo(display=display, **place),))).panels
    height = halves[0].pixels[1]
    left, right = noise(60, height), noise(60, height, 2)
    both = np.hstack([left, right])
    sink = WindowSink(halves, refresh_hz=60)
    try:
        sink.put([shown(halves[0], left), shown(halves[1], right)])
        assert looks_like(display, on_black(300, 200, (30, 20, both)) if named == "a window" else both)
        assert sink.notes == ()
    finally:
        sink.close()


def test_panels_of_both_eyes_side_by_side_lie_beside_each_other_on_a_desk(screens: tuple[str, str]) -> None:
    parts = expand(WallConfig(panels=tuple(stereo(x, display=screens[0]) for x in (0.0, 1.2)))).panels
    images = [noise(60, 45, seed) for seed in range(4)]
    sink = WindowSink(parts, refresh_hz=60)
    try:
        sink.put([shown(part, image) for part, image in zip(parts, images, strict=True)])
        assert looks_like(screens[0], on_black(300, 200, (30, 77, np.hstack(images))))
    finally:
        sink.close()


def test_a_image_of_another_size_is_scaled_without_borders_and_that_is_said_once(screens: tuple[str, str]) -> None:
    [one] = panels((60, 30), display=screens[1])
    ramp = np.zeros((30, 60, 3), np.uint8)
    ramp[..., 0] = 4 * np.arange(60)
    sink = WindowSink([one], refresh_hz=60)
    try:
        sink.put([shown(one, ramp)])
        # Linear filtering of a ramp is the ramp: pixel x of the screen sees image x / 2 - 0.25, held at both ends.
        wanted = np.clip(4 * (np.arange(120) / 2 - 0.25), 0, 4 * 59)
        assert comes_true(lambda: bool(np.all(np.abs(screenshot(screens[1])[..., 0] - wanted) <= 1)))
        assert sink.notes == ("panel p0: 60x30 pixels are scaled to the 120x90 of monitor screen",)
    finally:
        sink.close()


def test_panels_that_name_nothing_lie_side_by_side_as_on_the_wall(
    screens: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", screens[0])
    two = panels((100, 80), (60, 80))
    sink = WindowSink(two, refresh_hz=60)
    try:
        sink.put([shown(two[0], noise(100, 80)), shown(two[1], noise(60, 80, 2))])
        together = np.hstack([noise(100, 80), noise(60, 80, 2)])
        assert looks_like(screens[0], on_black(300, 200, (70, 60, together)))
    finally:
        sink.close()


def test_a_slow_display_gets_the_newest_image_and_the_rest_is_counted(screens: tuple[str, str]) -> None:
    [one] = panels((120, 90), display=screens[1])
    sink = WindowSink([one], refresh_hz=60)
    try:
        for version in range(1, 51):
            sink.put([shown(one, noise(120, 90, version), version)])
        assert sink.settled(SETTLED_S)
        assert looks_like(screens[1], noise(120, 90, 50))
        assert 0 <= sink.dropped().get("window_overtaken", 0) < 50
    finally:
        sink.close()


def test_windows_get_what_changed_and_show_exactly_all_of_it(screens: tuple[str, str]) -> None:
    """Both halves of a window change here and there, faster than it shows them."""
    halves = panels((60, 90), (60, 90), display=screens[1], of="p", at=[(0, 0), (60, 0)])
    rng = np.random.default_rng(1)
    images = [updated(shown(half, np.zeros((90, 60, 3), np.uint8), 0), noise(60, 90), 1) for half in halves]
    sink = WindowSink(halves, refresh_hz=60)
    try:
        sink.put(images)
        assert sink.settled(SETTLED_S)
        (host,) = sink.hosts
        before = host.copied
        assert before == 2 * 60 * 90 * 3
        rgb = images[1].rgb.copy()
        rgb[70, 40] ^= 255
        images[1] = updated(images[1], rgb, 2)
        sink.put(images)
        assert sink.settled(SETTLED_S)
        assert host.copied - before == (90 - 64) * (60 - 32) * 3  # the tile of that pixel, cut at the edges
        for version in range(3, 60):
            for k, image in enumerate(images):
                rgb = image.rgb.copy()
                for _ in range(rng.integers(0, 4)):
                    rgb[rng.integers(90), rng.integers(60)] ^= 255
                images[k] = updated(image, rgb, version)
            sink.put(images)
        assert sink.settled(SETTLED_S)
        assert looks_like(screens[1], np.hstack([image.rgb for image in images]))
        quiet = host.copied
        sink.put(images)
        assert host.copied == quiet
    finally:
        sink.close()


def test_many_scattered_changes_are_one_rectangle(screens: tuple[str, str]) -> None:
    [one] = panels((700, 700), display=screens[0], window=window(0, 0, 700, 700))
    first = updated(shown(one, np.zeros((700, 700, 3), np.uint8), 0), noise(700, 700), 1)
    rgb = first.rgb.copy()
    rgb[::64, ::64] ^= 255
    second = updated(first, rgb, 2)
    assert len(tile_rects(changed_since(second, 1), 700, 700)) > MOST_RECTS
    sink = WindowSink([one], refresh_hz=60)
    try:
        for image in (first, second):
            sink.put([image])
            assert sink.settled(SETTLED_S)
        assert looks_like(screens[0], second.rgb[:200, :300])
    finally:
        sink.close()


def test_a_display_that_cannot_be_opened_is_refused_before_anything_is_shown() -> None:
    with pytest.raises(
        RunError, match=r"panel p0: display :6553 cannot be opened \(X11: Failed to open display :6553\)"
    ):
        WindowSink(panels((8, 8), display=":6553"), refresh_hz=60)


def test_without_any_display_the_error_says_what_to_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(RunError, match=r"panel p0: no X display.*wanted `display` at the panel"):
        WindowSink(panels((8, 8)), refresh_hz=60)


def test_an_unknown_monitor_is_refused_with_those_that_there_are(screens: tuple[str, str]) -> None:
    wanted = rf"panel p0: display {screens[0]} has no monitor HDMI-7; it has 0 \(screen, 300x200\)"
    with pytest.raises(RunError, match=wanted):
        WindowSink(panels((8, 8), display=screens[0], monitor="HDMI-7"), refresh_hz=60)


def test_a_image_that_has_not_its_panels_size_is_refused(screens: tuple[str, str]) -> None:
    [one] = panels((20, 10), display=screens[0], window=window(0, 0, 20, 10))
    sink = WindowSink([one], refresh_hz=60)
    try:
        with pytest.raises(LocalProtocolError, match="panel p0: an image of 10x20 pixels for 20x10"):
            sink.put([shown(one, noise(10, 20))])
    finally:
        sink.close()


def test_keys_steer_and_escape_ends_the_run(screens: tuple[str, str]) -> None:
    [one] = panels((120, 90), display=screens[1])
    sink = WindowSink([one], refresh_hz=60)
    try:
        press(screens[1], XK.XK_Right, (60, 45))
        press(screens[1], XK.XK_period, (60, 45))
        press(screens[1], XK.XK_space, (60, 45))
        asked: list[dict[str, Any]] = []
        assert comes_true(lambda: asked.extend(sink.commands()) or len(asked) == 3)
        assert {command["kind"]: command for command in asked} == {
            "orbit": {"kind": "orbit", "x": 0.04, "y": 0.0},
            "seek": {"kind": "seek", "x": 0.5},
            "pause": {"kind": "pause"},
        }
        press(screens[1], XK.XK_Escape, (60, 45))
        assert comes_true(lambda: sink.finished == "Escape was pressed in the window of panel p0")
    finally:
        sink.close()


def test_a_window_that_is_closed_leaves_the_others_alone(screens: tuple[str, str]) -> None:
    two = panels((50, 40), (50, 40), display=screens[0], window=[window(0, 0, 50, 40), window(100, 0, 50, 40)])
    sink = WindowSink(two, refresh_hz=60)
    try:
        ask_to_close(screens[0], "wall p0")
        assert comes_true(lambda: sink.dropped() == {"window_closed": 1})
        sink.put([shown(two[0], noise(50, 40)), shown(two[1], noise(50, 40, 2))])
        assert sink.settled(SETTLED_S)
        assert looks_like(screens[0], on_black(300, 200, (100, 0, noise(50, 40, 2))))
        assert sink.finished == ""
        ask_to_close(screens[0], "wall p1")
        assert comes_true(lambda: sink.finished == "every window is closed")
    finally:
        sink.close()


def ask_to_close(display: str, title: str) -> None:
    """What a window manager sends when somebody closes a window."""
    from Xlib.protocol.event import ClientMessage

    server = Display(display)
    [found] = [w for w in server.screen().root.query_tree().children if w.get_wm_name() == title]
    kind, what = (server.intern_atom(name) for name in ("WM_PROTOCOLS", "WM_DELETE_WINDOW"))
    found.send_event(ClientMessage(window=found, client_type=kind, data=(32, [what, X.CurrentTime, 0, 0, 0])))
    server.sync()
    server.close()


def test_an_x_server_that_dies_takes_only_its_own_windows(screens: tuple[str, str]) -> None:
    with x_server("64x48") as other:
        two = panels((120, 90), (64, 48), display=[screens[1], other])
        sink = WindowSink(two, refresh_hz=60)
    try:
        assert comes_true(lambda: sink.dropped() == {"window_display_lost": 1})
        sink.put([shown(two[0], noise(120, 90)), shown(two[1], noise(64, 48))])
        assert sink.settled(SETTLED_S)
        assert looks_like(screens[1], noise(120, 90))
        assert sink.finished == ""
    finally:
        sink.close()


ALONE = """\
import sys, time
from test_windows import *
sink = WindowSink(panels((120, 90), display=sys.argv[1]), refresh_hz=60)
print(sink.hosts[0]._process.pid, flush=True)
time.sleep(600)
"""


def test_the_windows_die_with_a_run_that_is_killed(screens: tuple[str, str]) -> None:
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), str(here.parent.parent), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-c", ALONE, screens[1]]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path})
    assert run.stdout is not None
    child = int(run.stdout.readline())
    run.send_signal(signal.SIGKILL)
    run.wait()
    run.stdout.close()
    assert comes_true(lambda: not Path(f"/proc/{child}").exists() or "Z" in _state(child))


def _state(process: int) -> str:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "Z"
