"""The browser sink's server as a script sees it: real sockets, no page."""

from __future__ import annotations

import asyncio
import io
import json
import socket
import threading
import time
from contextlib import closing
from dataclasses import replace

import aiohttp
import numpy as np
import pytest
from page_viewer import PATIENCE_S, run, until, with_viewer
from PIL import Image

from wall.core.data import StatisticsImage
from wall.core.errors import RunError
from wall.display.browser import IN_FLIGHT, STATUS_PERIOD_S, Browser
from wall.display.png import whole_wall
from wall.display.stream import STATISTICS_HEADER
from wall.display.viewer import visit


@pytest.fixture
def browser(two_panels):
    sink = Browser("127.0.0.1", 0, two_panels, max_viewers=2)
    with closing(sink):
        yield sink


async def get(browser, path="", **headers):
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    async with (
        aiohttp.ClientSession() as session,
        session.get(browser.address + path, headers=named) as response,
    ):
        return response.status, response.headers, await response.read()


def test_only_changed_panels_are_sent(browser, image, status):
    first = image(1)
    changed = replace(first, panels=(first.panels[0], replace(first.panels[1], version=2)))

    async def act(viewer):
        browser.show(first, status)
        number, panels = await viewer.next_image()
        await viewer.drawn(number)
        browser.show(changed, status)
        return panels, (await viewer.next_image())[1]

    first_panels, second_panels = with_viewer(browser, act)
    assert {k: v for k, (v, _) in first_panels.items()} == {0: 1, 1: 1}
    assert {k: v for k, (v, _) in second_panels.items()} == {1: 2}
    assert abs(first_panels[1][1].astype(int) - first.panels[1].rgb).max() <= 2  # flat colour


def test_who_wants_nothing_gets_no_image_and_no_status_until_it_wants_some(browser, image, status):
    async def act(viewer):
        await viewer.socket.send_json({"kind": "display", "value": "nothing"})
        assert (await viewer.socket.receive_json())["kind"] == "layout"
        await until(lambda: not any(seen.shows for seen in browser._viewers))
        browser.show(image(1), status)
        with pytest.raises(TimeoutError):
            await viewer.socket.receive(timeout=1.5 * STATUS_PERIOD_S)
        await viewer.socket.send_json({"kind": "display", "value": "images"})
        return await viewer.next_image()

    _, panels = with_viewer(browser, act)
    assert panels.keys() == {0, 1}


def test_slow_viewer_has_no_backlog_and_gets_the_newest_next(browser, image, status):
    async def act(viewer):
        browser.show(image(1), status)
        numbers = [(await viewer.next_image())[0]]
        for version in range(2, 2 + IN_FLIGHT - 1):
            browser.show(image(version), status)
            numbers.append((await viewer.next_image())[0])
        for version in range(100, 200):
            browser.show(image(version), status)
        quiet = await viewer.silent_while(0.3)
        await viewer.drawn(numbers[-1])
        return quiet, await viewer.next_image()

    quiet, (_, panels) = with_viewer(browser, act)
    assert quiet
    assert panels[0][0] == 199


def test_a_visitor_draws_what_it_gets_and_steers(browser, image, status):
    browser.show(image(1), status)
    pause = {"kind": "pause"}
    assert visit(browser.address, [pause], display="images", seconds=2.0) >= 1
    assert browser.commands() == [pause]
    assert browser.dropped() == {}
    with pytest.raises(RunError, match="no page of a wall answers"):
        visit("http://127.0.0.1:9/", [], display="images", seconds=0.3)


def test_a_visitor_of_a_page_that_goes_is_told_so_at_once(browser, image, status):
    browser.show(image(1), status)
    threading.Timer(0.5, browser.close).start()
    began = time.monotonic()
    with pytest.raises(RunError, match="it has gone"):
        visit(browser.address, [], display="images", seconds=30.0)
    assert time.monotonic() < began + 20.0


def test_a_status_is_told_without_an_image(browser, image, status):
    marked = replace(status, stale=((0.0, 0.0, 4.0, 4.0),))

    async def act(viewer):
        browser.show(image(1), status)
        await viewer.next_image()
        browser.tell(marked)
        return (await get(browser, "status.json"))[2]

    browser.tell(marked)  # before the first image there is nobody to be told
    assert json.loads(with_viewer(browser, act))["stale"] == [[0.0, 0.0, 4.0, 4.0]]


def test_new_viewer_gets_the_whole_wall_though_nothing_changes(browser, image, status):
    browser.show(image(5), status)

    async def act(viewer):
        return (await viewer.next_image())[1]

    assert {k: v for k, (v, _) in with_viewer(browser, act).items()} == {0: 5, 1: 5}


def test_viewer_hears_layout_then_status(browser, image, status):
    browser.show(image(1), status)

    async def act(viewer):
        await viewer.next_image()
        return viewer.statuses

    layout, first = with_viewer(browser, act)
    assert (layout["kind"], first["kind"]) == ("layout", "status")
    assert [p["id"] for p in layout["panels"]] == ["r0c0", "r0c1"]
    assert first["sampler"] == "hilbert"


def test_viewers_and_those_who_come_later_hear_of_another_layout(browser, two_panels, image, status):
    browser.show(image(1), status)

    async def act(viewer):
        await viewer.next_image()
        browser.lay_out(two_panels, ["main", "map"], ["", "a view lies over it"])
        while (heard := viewer.statuses[-1])["kind"] != "layout" or heard["views"] != ["main", "map"]:
            viewer.statuses.append(await viewer.socket.receive_json())
        return heard

    async def later(viewer):
        return await viewer.socket.receive_json()

    assert with_viewer(browser, act) == with_viewer(browser, later)


def test_second_images_are_sent_while_there_are_some_and_only_when_they_changed(browser, image, status):
    alone, second = image(1), image(4, value=20)
    both = replace(alone, compared=second.panels)
    one_newer = replace(both, compared=(second.panels[0], replace(second.panels[1], version=5)))

    async def act(viewer):
        found = []
        for shown in (alone, both, one_newer, image(2)):
            browser.show(shown, status)
            number, panels = await viewer.next_image()
            await viewer.drawn(number)
            found.append(panels)
        return found

    found = with_viewer(browser, act)
    versions = [{k: v for k, (v, _) in panels.items()} for panels in found]
    assert versions == [
        {0: 1, 1: 1}, {("compared", 0): 4, ("compared", 1): 4}, {("compared", 1): 5}, {0: 2, 1: 2},
    ]  # fmt: skip
    assert abs(found[1]["compared", 1][1].astype(int) - 21).max() <= 2


async def received_statistics(viewer):
    """The next binary message."""
    while (message := await viewer.socket.receive()).type is not aiohttp.WSMsgType.BINARY:
        pass
    return message.data


def statistics_image(panel=0, value=1):
    codes = np.full((1, 2), value, np.uint8)
    return StatisticsImage(
        panel=panel, compared=False, age=codes, density=codes + 1, rects=np.array([[0, 0, 16, 8]], np.uint16),
        error_reduction=np.array([value + 2], np.uint8),
    )  # fmt: skip


def test_statistics_go_only_to_those_who_look_and_once(browser, image, status):
    async def act(viewer):
        browser.show(replace(image(1), statistics_images=(statistics_image(),)), status)
        number, _ = await viewer.next_image()
        await viewer.drawn(number)
        quiet_before = await viewer.silent_while(0.1)
        await viewer.socket.send_json({"kind": "overlay", "value": "density"})
        density = await received_statistics(viewer)
        quiet_between = await viewer.silent_while(0.1)
        browser.show(replace(image(1), statistics_images=(statistics_image(value=7),)), status)
        newer = await received_statistics(viewer)
        await viewer.socket.send_json({"kind": "overlay", "value": "tiles"})
        return quiet_before, quiet_between, density, newer, await received_statistics(viewer)

    quiet_before, quiet_between, density, newer, tiles = with_viewer(browser, act)
    assert quiet_before
    assert quiet_between
    assert density[STATISTICS_HEADER.size :] == bytes([2, 2])
    assert newer[STATISTICS_HEADER.size :] == bytes([8, 8])
    assert tiles[STATISTICS_HEADER.size :] == bytes([0, 0, 0, 0, 16, 0, 8, 0, 9])


def test_compositors_make_statistics_from_the_first_overlay_to_the_last_even_if_its_viewer_just_leaves(browser):
    def said(found):
        found.extend(browser.commands())
        return found

    async def act(viewer):
        found, url = [], browser.address + "stream"
        async with aiohttp.ClientSession() as session, session.ws_connect(url) as second:
            for socket_ in (viewer.socket, second):
                await socket_.send_json({"kind": "overlay", "value": "age"})
            await until(lambda: said(found))
            await viewer.socket.send_json({"kind": "overlay", "value": ""})
            await asyncio.sleep(0.05)
            assert not browser.commands(), "one still looks"
        await until(lambda: len(said(found)) > 1)
        return found

    assert with_viewer(browser, act) == [{"kind": "statistics", "value": "on"}, {"kind": "statistics", "value": ""}]


def test_answer_to_a_command_does_not_wait_for_the_next_status(browser, image, status, monkeypatch):
    monkeypatch.setattr("wall.display.browser.STATUS_PERIOD_S", 10 * PATIENCE_S)
    browser.show(image(1), status)

    async def act(viewer):
        number, _ = await viewer.next_image()
        await viewer.drawn(number)
        browser.show(image(1), replace(status, paused=True))
        return await viewer.socket.receive_json()

    assert with_viewer(browser, act)["paused"] is True


def test_commands_arrive_in_order_and_garbage_is_only_counted(browser):
    async def act(viewer):
        await viewer.socket.send_str('{"kind":"orbit","x":0.5,"y":0}')
        await viewer.socket.send_str("garbage")
        await viewer.socket.send_bytes(b"\x00\xff")
        await viewer.socket.send_json({"kind": "shown", "number": 99})  # was never sent
        await viewer.socket.send_str('{"kind":"pause"}')
        got = []
        while len(got) < 2:
            got += browser.commands()
            await asyncio.sleep(0.005)
        return got

    assert with_viewer(browser, act) == [{"kind": "orbit", "x": 0.5, "y": 0}, {"kind": "pause"}]
    assert browser.dropped() == {"browser_bad_message": 3}


def test_commands_that_nobody_fetches_are_bounded(browser):
    async def act(viewer):
        for k in range(300):
            await viewer.socket.send_json({"kind": "orbit", "x": k / 100, "y": 0})
        await until(lambda: browser.dropped().get("browser_command_overflow") == 300 - 256)

    with_viewer(browser, act)
    kept = browser.commands()
    assert [c["x"] for c in kept] == [k / 100 for k in range(256)]


def test_message_that_is_too_long_ends_only_that_viewer(browser, image, status):
    async def shout(viewer):
        await viewer.socket.send_str("x" * 100_000)
        while (message := await viewer.socket.receive()).type is aiohttp.WSMsgType.TEXT:
            pass
        return message.data

    assert with_viewer(browser, shout) == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
    browser.show(image(1), status)

    async def act(viewer):
        return await viewer.next_image()

    assert with_viewer(browser, act)[0] == 1


def test_viewers_beyond_the_limit_are_told_to_come_again(browser):
    async def act(viewer):
        url = browser.address + "stream"
        async with aiohttp.ClientSession() as session, session.ws_connect(url) as second:
            await second.receive_json()
            async with session.ws_connect(url) as third:
                return (await third.receive()).data

    assert with_viewer(browser, act) == aiohttp.WSCloseCode.TRY_AGAIN_LATER
    assert browser.dropped() == {"browser_viewer_refused": 1}


def test_foreign_pages_get_nothing(browser, image, status):
    browser.show(image(1), status)
    assert run(get(browser, Host="evil.example"))[0] == 403
    assert run(get(browser, "wall.png", Sec_Fetch_Site="cross-site"))[0] == 403
    with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
        with_viewer(browser, lambda viewer: None, origin="http://evil.example")
    assert browser.dropped() == {"browser_foreign_request": 3}


@pytest.mark.parametrize(
    "path",
    ["../browser.py", "%2e%2e/browser.py", "%2e%2e%2fbrowser.py", "page.py", "missing.js", "x" * 300 + ".js", "%00.js"],
)
def test_only_the_pages_own_files_are_served(browser, path):
    assert run(get(browser, path))[0] == 404


def test_page_and_its_parts_are_served_and_load_nothing_from_elsewhere(browser):
    status_code, headers, body = run(get(browser))
    assert status_code == 200
    assert b"<title>wall</title>" in body
    assert headers["Content-Security-Policy"].startswith("default-src 'self'")
    for name, kind in [("page.js", "text/javascript"), ("wall.js", "text/javascript"), ("page.css", "text/css")]:
        code, headers, text = run(get(browser, name))
        assert (code, headers["Content-Type"]) == (200, f"{kind}; charset=utf-8")
        assert b"//cdn" not in text
        assert b"@import" not in text


def test_scripts_get_image_and_status(browser, image, status):
    assert run(get(browser, "wall.png"))[0] == run(get(browser, "status.json"))[0] == 503  # nothing yet
    shown = image(3)
    browser.show(shown, status)
    code, _, png = run(get(browser, "wall.png"))
    assert code == 200
    assert np.array_equal(np.array(Image.open(io.BytesIO(png))), whole_wall(shown))
    assert json.loads(run(get(browser, "status.json"))[2])["samplers"] == ["framed", "hilbert"]


def test_taken_port_is_refused_by_number(two_panels):
    with closing(socket.socket()) as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(RunError, match=rf"127\.0\.0\.1 port {port}: another program has this port"):
            Browser("127.0.0.1", port, two_panels)


@pytest.mark.parametrize("host", ["no.such.host.invalid", "192.0.2.1", "::zz"])
def test_address_that_is_not_ours_is_refused_by_name(two_panels, host):
    with pytest.raises(RunError, match=f"cannot be served at {host}"):
        Browser(host, 0, two_panels)


def test_close_tells_the_viewers_within_a_second_even_one_that_does_not_listen(browser, image, status):
    browser.show(image(1), status)

    async def act(viewer):
        async with aiohttp.ClientSession() as session, session.ws_connect(browser.address + "stream"):  # deaf
            await viewer.next_image()
            before = time.monotonic()
            closing_it = asyncio.get_running_loop().run_in_executor(None, browser.close)
            while (message := await viewer.socket.receive()).type is not aiohttp.WSMsgType.CLOSE:
                pass
            await closing_it
            return message.data, time.monotonic() - before

    code, seconds = with_viewer(browser, act)
    assert code == aiohttp.WSCloseCode.GOING_AWAY
    assert seconds < 1.0
    assert not browser._server._thread.is_alive()


def test_show_after_close_is_harmless(browser, image, status):
    browser.close()
    browser.show(image(1), status)
    browser.close()
    assert browser.commands() == []
