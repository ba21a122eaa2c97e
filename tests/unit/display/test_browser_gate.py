"""Who gets in at the page: with a token to steer, with one to watch, encrypted, so many and so much at once."""

from __future__ import annotations

import socket
import time
from contextlib import ExitStack, closing
from pathlib import Path
from urllib.parse import urlsplit

import aiohttp
import pytest
from page_viewer import PATIENCE_S, Viewer, run, until

from wall.core.errors import RunError
from wall.display import gate
from wall.display.browser import Browser
from wall.display.gate import BURST, Access, Pace
from wall.display.viewer import watch

TLS = Path(__file__).with_name("tls.pem")  # certificate and key
ORBIT = {"kind": "orbit", "x": 0.5, "y": 0}
PATHS = ("", "page.js", "stream", "wall.png", "status.json", "metrics")


@pytest.fixture
def browser(two_panels):
    with closing(Browser("127.0.0.1", 0, two_panels, max_viewers=4, access=Access(tokens=True))) as sink:
        yield sink


def base(browser):
    return urlsplit(browser.address)._replace(query="").geturl()


def watching(browser):
    """The address that lets watch, as it is printed."""
    found = browser.watch_address
    assert found != browser.address
    return found


def stream(address):
    return urlsplit(address)._replace(path="/stream").geturl()


def ended(connection):
    connection.settimeout(PATIENCE_S)
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


async def statuses(session, urls):
    found = []
    for url in urls:
        async with session.get(url, allow_redirects=False) as response:
            found.append(response.status)
    return found


def test_without_its_token_nothing_is_served(browser, image, status):
    browser.show(image(1), status)
    with_other = [f"{base(browser)}{path}?token={token}" for path in PATHS for token in ("x", "", "%ff", "ü")]

    async def act():
        async with aiohttp.ClientSession() as session:
            return await statuses(session, [base(browser) + path for path in PATHS] + with_other)

    found = run(act())
    assert found == [403] * len(found)
    assert browser.dropped() == {"browser_no_token": len(found)}


def test_the_token_of_the_address_becomes_a_cookie_that_opens_all_of_the_page(browser, image, status):
    browser.show(image(1), status)

    async def act():
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as session:
            async with session.get(browser.address) as response:
                (redirect,) = response.history
                cookie = redirect.headers["Set-Cookie"]
                assert str(response.url) == base(browser), "the token does not stay in the address bar"
            paths = await statuses(session, [base(browser) + path for path in PATHS if path != "stream"])
            async with session.ws_connect(base(browser) + "stream") as ws:
                await Viewer(ws).next_image()
                await ws.send_json(ORBIT)
                await until(lambda: (taken := browser.commands()) and taken == [ORBIT])
        return cookie, paths

    cookie, paths = run(act())
    assert "HttpOnly" in cookie
    assert "SameSite=Lax" in cookie
    assert paths == [200] * 5


def test_who_may_only_watch_is_told_so_and_changes_nothing(browser, image, status):
    browser.show(image(1), status)

    async def act():
        async with aiohttp.ClientSession() as session, session.ws_connect(stream(watching(browser))) as ws:
            viewer = Viewer(ws)
            number, _ = await viewer.next_image()
            await viewer.drawn(number)
            for command in (ORBIT, {"kind": "pause"}, {"kind": "overlay", "value": "age"}):
                await ws.send_json(command)
            await until(lambda: browser.dropped().get("browser_watcher_refused") == 2)
            return viewer.statuses, browser.commands()

    heard, commands = run(act())
    assert [message["kind"] for message in heard[:2]] == ["layout", "access"]
    assert heard[1]["steers"] is False
    assert [command["kind"] for command in commands] in ([], ["statistics"]), "what it lays over its own image"
    assert browser.dropped() == {"browser_watcher_refused": 2}


def test_those_who_watch_leave_places_for_those_who_steer(browser):
    async def act():
        async with aiohttp.ClientSession() as session:
            watchers = [await session.ws_connect(stream(watching(browser))) for _ in range(3)]
            first = [(await ws.receive()).type for ws in watchers]
            for _ in range(2):
                async with session.ws_connect(stream(browser.address)) as ws:
                    first.append((await ws.receive()).type)
            return first

    text, closed = aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.CLOSE
    assert run(act()) == [text, text, closed, text, text]


def test_who_sends_too_much_at_once_is_sent_away_and_others_stay(browser, image, status):
    browser.show(image(1), status)

    async def act():
        async with aiohttp.ClientSession() as session, session.ws_connect(stream(browser.address)) as calm:
            async with session.ws_connect(stream(browser.address)) as hasty:
                for _ in range(3 * int(BURST)):
                    await hasty.send_json({"kind": "shown", "number": 0})
                while (said := await hasty.receive()).type is not aiohttp.WSMsgType.CLOSE:
                    pass
            assert await Viewer(calm).next_image()
            return said.data

    assert run(act()) == aiohttp.WSCloseCode.POLICY_VIOLATION
    assert browser.dropped()["browser_too_fast"] == 1


def test_pace_is_that_of_a_second():
    pace = Pace(0.0)
    assert [pace.allows(0.0) for _ in range(int(BURST) + 1)] == [True] * int(BURST) + [False]
    assert pace.allows(1.0)
    steady = Pace(0.0)
    assert all(steady.allows(k / gate.RATE) for k in range(5000))


def test_connections_that_ask_for_nothing_are_closed(two_panels, image, status, monkeypatch):
    monkeypatch.setattr(gate, "MAX_SILENT", 3)
    monkeypatch.setattr(gate, "FIRST_REQUEST_S", 1000.0)
    monkeypatch.setattr(gate, "SWEEP_S", 0.01)
    with closing(Browser("127.0.0.1", 0, two_panels, access=Access(tokens=True))) as browser, ExitStack() as stack:
        browser.show(image(1), status)
        place = urlsplit(browser.address)
        silent = [stack.enter_context(socket.create_connection((place.hostname, place.port))) for _ in range(8)]
        limit = time.monotonic() + PATIENCE_S
        while browser.dropped().get("browser_silent_connection", 0) < 5:
            assert time.monotonic() < limit
            time.sleep(0.01)
        monkeypatch.setattr(gate, "FIRST_REQUEST_S", 0.05)

        async def act():
            async with aiohttp.ClientSession() as session, session.ws_connect(stream(browser.address)) as ws:
                await until(lambda: browser.dropped()["browser_silent_connection"] == len(silent))
                return await Viewer(ws).next_image()

        assert run(act())[1].keys() == {0, 1}, "who has asked stays"
        assert all(ended(one) for one in silent)


def test_an_encrypted_page_has_a_secure_cookie_and_speaks_nothing_else(two_panels, image, status):
    with closing(Browser("127.0.0.1", 0, two_panels, access=Access(tokens=True, tls=(TLS, TLS)))) as browser:
        browser.show(image(1), status)
        assert browser.address.startswith("https://127.0.0.1:")
        assert not any("is not encrypted" in note for note in browser.notes)

        async def act():
            async with aiohttp.ClientSession() as session:
                async with session.get(browser.address, ssl=False, allow_redirects=False) as response:
                    cookie = response.headers["Set-Cookie"]
                async with session.ws_connect(stream(browser.address), ssl=False) as ws:
                    await Viewer(ws).next_image()
                with pytest.raises(aiohttp.ClientError):
                    await session.get(browser.address.replace("https", "http"))
            return cookie

        assert "Secure" in run(act())


def test_files_that_are_no_certificate_are_refused_by_name(two_panels, tmp_path):
    empty = tmp_path / "empty.pem"
    empty.touch()
    for file in (empty, tmp_path / "missing.pem"):
        with pytest.raises(RunError, match=rf"output\.browser\.tls: {file} with .*wanted: a certificate and its key"):
            Browser("127.0.0.1", 0, two_panels, access=Access(tls=(file, TLS)))


def test_a_script_that_watches_passes_the_token_on(browser, image, status, monkeypatch):
    monkeypatch.setattr("wall.display.viewer.SETTLE_S", 0.0)
    browser.show(image(1), status)
    assert watch(browser.address, display="images", seconds=0.5).images >= 1
    with pytest.raises(RunError, match="no page of a wall answers"):
        watch(base(browser), display="images", seconds=0.05)
