"""Requests over the page's WebSocket, by a program that is no page and by wall.client: a manager answers each."""

from __future__ import annotations

import asyncio
import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, get_args
from urllib.parse import urlsplit

import aiohttp
import pytest
from manager_run import plan_of

from wall.client import Client, connect
from wall.core.errors import EditError, RunError
from wall.display.base import Answer
from wall.display.browser import Browser
from wall.display.gate import Access
from wall.display.page_client import stream_of
from wall.display.page_viewer import MAX_REQUESTS
from wall.display.requests import Requests
from wall.display.steering import MAX_LOAD_BYTES, MAX_REQUEST_BYTES
from wall.geometry.steering import Kind
from wall.packets.control import EditRequest
from wall.roles.instructions import MANAGER
from wall.roles.manager import Manager
from wall.roles.plan import HEAD
from wall.run.clock import HeadClock
from wall.run.loop import Loop
from wall.run.page_requests import message_of, request_of
from wall.run.ports import Ports
from wall.run.sinks import page_answers, window_input_of
from wall.transport.loopback import LoopbackHub

GUIDE = Path(__file__).parents[3] / "docs/guide/websocket.md"
KEY, PATIENCE_S = "secret", 10.0
TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views:
  - {id: main, panels: [r0c0], camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}
  - {id: map, panels: [r0c1], camera: {position: [0, 24, 0.01], target: [0, 0, 0]}}
"""


class Served:
    """A wall without renderers: its page, and its manager in a thread."""

    def __init__(self, text: str = TEXT, **options: Any) -> None:
        plan, clock, hub = plan_of(text), HeadClock(), LoopbackHub(credit_bytes=1 << 20)
        self.browser = Browser("127.0.0.1", 0, plan.layout.wall, access=Access(tokens=True), **options)
        self.manager = Manager(plan, clock.now(), still=True, key=KEY)
        ports = Ports(MANAGER, clock, hub=hub)
        ports.answer_page = page_answers([self.browser])
        sources = [window_input_of(HEAD, [self.browser], KEY)]
        self.loop = Loop(self.manager, ports, clock, sources=sources, longest_wait_s=0.002)
        self._thread = threading.Thread(target=self.loop.run)
        self._thread.start()

    @property
    def address(self) -> str:
        return self.browser.address

    @property
    def watching(self) -> str:
        """The address that lets watch."""
        return self.browser.watch_address

    def positions(self) -> list[tuple[float, ...]]:
        return [tuple(event.camera.position) for event in self.manager.events]

    def close(self) -> None:
        self.loop.finished = True
        self.browser.close()
        self._thread.join()


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with closing(Served()) as wall:
        yield wall


def told(address: str, *messages: object, answers: int | None = None) -> list[dict[str, Any]]:
    """The answers to messages, as many as there are ids among them; a text is sent as it is."""
    wanted = sum("id" in m for m in messages if isinstance(m, dict)) if answers is None else answers

    async def act() -> list[dict[str, Any]]:
        found = list[dict[str, Any]]()
        async with aiohttp.ClientSession() as session, session.ws_connect(stream_of(address), max_msg_size=0) as wall:
            for message in messages:
                await wall.send_str(message if isinstance(message, str) else json.dumps(message))
            while len(found) < wanted:
                message = await wall.receive()
                if message.type is aiohttp.WSMsgType.CLOSE:
                    return [{"closed": message.data}]
                if message.type is aiohttp.WSMsgType.TEXT and message.json()["kind"] == "answer":
                    found.append(message.json())
        return found

    return asyncio.run(asyncio.wait_for(act(), PATIENCE_S))


def test_every_message_of_the_guide_is_answered_as_done() -> None:
    (block,) = (part for part in GUIDE.read_text(encoding="utf-8").split("```") if part.startswith("json\n"))
    messages = [json.loads(line) for line in block.splitlines()[1:]]
    one_view = "\n".join(line for line in TEXT.replace("panels: [r0c0], ", "").splitlines() if "map" not in line)
    with closing(Served(one_view)) as wall:
        answers = told(wall.address, *messages)
    assert [answer["id"] for answer in answers] == [message["id"] for message in messages]
    assert [answer.get("refused") for answer in answers] == [None] * len(messages)
    without = {"focus", "load", "edit", "choose"}  # no lens, no leave, nothing to choose
    kinds = {message["kind"] for message in messages} | without
    table = GUIDE.read_text(encoding="utf-8").partition("## Requests")[2].partition("`view` is a")[0]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert kinds | {"kind"} == {word for row in rows for word in row.split("`")[1::2]}
    assert kinds == {*get_args(Kind), "list", "load", "edit", "choose"} - {"statistics"}


def test_assignments_hold_all_or_none_and_the_sender_hears_why(served: Served) -> None:
    values = {"exposure": 1, "lights.2.irradiance": [0, 0, 9]}
    done, refused, listed = told(
        served.address,
        {"id": 1, "kind": "set", "values": values},
        {"id": "two", "kind": "set", "values": {"exposure": 5, "sky.strength": -1}},
        {"id": 3, "kind": "list", "names": ["exposure", "lights.2.i*", "nothing"]},
    )
    assert done.keys() == {"kind", "id", "edit"}
    assert (refused["id"], refused["refused"].split(":")[0]) == ("two", "sky.strength = -1")
    assert (listed["edit"], listed["left_out"]) == (done["edit"], 0)
    assert {row["name"]: row["value"] for row in listed["parameters"]} == {
        "exposure": [1.0], "lights.2.irradiance": [0.0, 0.0, 9.0],
    }  # fmt: skip
    undone, listed = told(
        served.address, {"id": 1, "kind": "undo"}, {"id": 2, "kind": "list", "names": ["exposure"]}
    )  # fmt: skip
    assert undone["edit"] == done["edit"] + 1
    assert listed["parameters"][0]["value"] == [0.0]


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ({"kind": "set", "values": {"no.such": 1}}, "no.such"),
        ({"kind": "set", "values": [1]}, "up to 64 names"),
        ({"kind": "set", "values": {f"p{k}": 1 for k in range(65)}}, "up to 64 names"),
        ({"kind": "set", "values": {"exposure": 1}, "more": 1}, "set came with more: want values"),
        ({"kind": "set", "name": "exposure"}, "want a name, and numbers or null"),
        ({"kind": "set", "name": "exposure", "numbers": ["a"]}, "want a number"),
        ({"kind": "list", "names": []}, "list of 1 to 64 patterns"),
        ({"kind": "undo", "steps": 0}, "want a whole number from 1"),
        ({"kind": "orbit", "x": 99, "y": 0}, "from -10 to 10"),
        ({"kind": "orbit", "x": 1}, "want x, y"),
        ({"kind": "zoom", "x": 1.1, "view": "plan"}, "want one of main, map"),
        ({"kind": "zoom", "x": 1.1, "view": 2}, "want one of 0 (main), 1 (map)"),
        ({"kind": "recall", "value": "9"}, "no camera was kept as 9"),
        ({"kind": "compare", "value": "framed"}, "one view"),
        ({"kind": "pause", "paused": 1}, "want true or false"),
        ({"kind": "statistics", "value": "on"}, "overlay"),
        ({"kind": "explode"}, "want one of orbit"),
        ({"kind": "load", "text": "version: 1"}, "output.browser.load"),
        ({"kind": "edit", "changes": ["views-=map"]}, "output.browser.load"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_what_is_wrong_is_answered_and_changes_nothing(served: Served, message: dict[str, Any], why: str) -> None:
    before, number = served.positions(), served.manager.editor.count
    (answer,) = told(served.address, {"id": 5, **message})
    assert why in answer["refused"]
    assert (served.positions(), served.manager.editor.count) == (before, number)


@pytest.mark.parametrize(
    "text",
    ["[1]", '{"id": 1}', '{"id": 1, "kind": 2}', '{"id": -1, "kind": "pause"}', '{"id": 1.5, "kind": "pause"}',
     '{"id": "", "kind": "pause"}', '{"id": [1], "kind": "pause"}', '{"id": 1, "kind": "seek", "x": Infinity}',
     '{"kind": "list"}', '{"kind": "zoom", "x": 2, "view": "map"}'],
)  # fmt: skip
def test_what_is_no_request_has_no_answer_and_is_counted(served: Served, text: str) -> None:
    before = served.browser.dropped().get("browser_bad_message", 0)
    (answer,) = told(served.address, text, {"id": 6, "kind": "list"})
    assert answer["id"] == 6
    assert served.browser.dropped()["browser_bad_message"] == before + 1


def test_messages_without_an_id_do_what_they_did_and_keep_their_place_among_requests(served: Served) -> None:
    main, plan = served.positions()
    told(
        served.address,
        {"kind": "set", "name": "exposure", "numbers": [2]},
        {"kind": "orbit", "x": 0.25, "y": 0},
        {"id": 1, "kind": "undo"},
        {"id": 2, "kind": "zoom", "x": 2, "view": "map"},
    )
    assert served.manager.editor.picture.get("exposure") != (2.0,)
    limit = time.monotonic() + PATIENCE_S
    while main == served.positions()[0] or plan == served.positions()[1]:
        assert time.monotonic() < limit


def test_who_may_only_watch_is_told_so_and_changes_nothing(served: Served) -> None:
    before = served.positions(), served.manager.editor.count
    answers = told(
        served.watching,
        {"id": 1, "kind": "set", "values": {"exposure": 3}},
        {"id": 2, "kind": "orbit", "x": 1, "y": 0},
        {"id": 3, "kind": "load", "text": "version: 1"},
    )
    assert all("lets watch" in answer["refused"] for answer in answers)
    assert (served.positions(), served.manager.editor.count) == before
    long = json.dumps({"id": 1, "kind": "list", "names": ["x" * 1024]})
    assert told(served.watching, long, answers=1) == [{"closed": aiohttp.WSCloseCode.MESSAGE_TOO_BIG}]
    with connect(served.watching) as run, pytest.raises(EditError, match="lets watch"):
        run.set({"exposure": 3})


def test_more_requests_than_wait_at_once_are_all_answered(served: Served) -> None:
    many = [{"id": k, "kind": "set", "values": {"sky.strength": k}} for k in range(4 * MAX_REQUESTS)]
    assert sorted(answer["id"] for answer in told(served.address, *many)) == list(range(4 * MAX_REQUESTS))


def test_long_messages_are_refused_and_count_as_several() -> None:
    with closing(Served(load=True)) as wall:
        long = {"id": 1, "kind": "set", "values": {"x" * MAX_REQUEST_BYTES: 1}}
        (answer,) = told(wall.address, long)
        assert f"want at most {MAX_REQUEST_BYTES}" in answer["refused"]
        umlauts = json.dumps({"id": 1, "kind": "load", "text": "\u00e4" * 200_000}, ensure_ascii=False)
        (answer,) = told(wall.address, umlauts, answers=1)
        assert "load" in answer["refused"], "its bytes do not fit into one message to the ranks"
        too_long = {"id": 1, "kind": "load", "text": "x" * MAX_LOAD_BYTES}
        assert told(wall.address, too_long) == [{"closed": aiohttp.WSCloseCode.MESSAGE_TOO_BIG}]
        many = [{"id": k, "kind": "undo", "steps": 0, "more": "x" * 400_000} for k in range(3)]
        (*_, last) = told(wall.address, *many)
        assert last == {"closed": aiohttp.WSCloseCode.POLICY_VIOLATION}


def test_a_client_at_an_address_does_what_one_at_the_folder_does(served: Served) -> None:
    with connect(served.address) as run:
        number = run.set({"exposure": 1.5, "lights.2.irradiance": (0, 0, 9)})
        parameters = run.parameters("exposure", "lights.2.irradiance")
        assert parameters["exposure"].value == (1.5,)
        assert parameters["lights.2.irradiance"].value == (0.0, 0.0, 9.0)
        assert not any(name.startswith("objects.") for name in run.parameters())
        with pytest.raises(EditError, match="irradiance = -1: want three numbers"):
            run.set({"exposure": 0, "lights.2.irradiance": -1})
        assert run.undo() == number + 1
        with pytest.raises(EditError, match=r"output\.browser\.load"):
            run.load(TEXT)

        main, plan = served.positions()
        run.orbit(0.5, 0.1, view="map")
        run.zoom(2, view=1)
        until(lambda: served.positions()[1] != plan)
        assert served.positions()[0] == main
        run.reset(view="map")
        run.seek(3)
        until(lambda: served.manager.events[0].scene_time == 3.0 or served.positions()[1] == plan)
        assert served.manager.events[0].paused
        run.pause(False)
        until(lambda: not served.manager.events[0].paused)
        run.pause()
        run.pause()
        until(lambda: served.manager.events[0].paused)


def until(condition: Any) -> None:
    limit = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < limit
        time.sleep(0.002)


def test_where_nobody_is_let_in_or_no_wall_is_there_is_told_within_the_patience(served: Served) -> None:
    began = time.monotonic()
    bare = urlsplit(served.address)._replace(query="").geturl()
    for address in (bare, bare + "?token=wrong"):
        with pytest.raises(RunError, match="lets nobody in by this token"):
            connect(address)
    with pytest.raises(RunError, match="no wall answers"):
        connect("http://127.0.0.1:9/")
    with pytest.raises(RunError, match="no wall answers"):
        connect("https://" + served.address.removeprefix("http://"))
    with pytest.raises(RunError, match="there is no wall"):
        connect(bare.rstrip("/") + "/metrics?" + urlsplit(served.address).query)
    with socket.create_server(("127.0.0.1", 0)) as silent, pytest.raises(RunError, match=r"no answer within 0\.3 s"):
        connect(f"http://127.0.0.1:{silent.getsockname()[1]}/", patience_s=0.3)
    assert time.monotonic() - began < PATIENCE_S


def test_a_wall_that_ends_or_is_silent_is_told_to_who_asks() -> None:
    wall = Served()
    with connect(wall.address, patience_s=0.3) as run:
        wall.loop.finished = True  # its manager hangs, its page does not
        with pytest.raises(RunError, match=r"no answer within 0\.3 s"):
            run.undo()
        waiting = list[Exception]()

        def ask(client: Client) -> None:
            try:
                client.request(undo=1, patience_s=PATIENCE_S)
            except RunError as error:
                waiting.append(error)

        thread = threading.Thread(target=ask, args=(run,))
        thread.start()
        wall.close()
        thread.join()
        assert "the wall has ended" in str(waiting[0])
        with pytest.raises(RunError, match="the wall has ended"):
            run.undo()
    with pytest.raises(RunError, match="this client is closed"):
        run.undo()


def test_an_answer_that_json_cannot_say_is_refused_and_not_lost() -> None:
    requests = Requests[str](loads=False)
    number, _ = requests.take("viewer", {"kind": "list", "id": "a"})
    found = requests.answered(number, Answer(edit=3, parameters=({"value": [math.inf]},)))
    assert found is not None
    viewer, text = found
    assert (viewer, json.loads(text)["id"]) == ("viewer", "a")
    assert json.loads(text)["refused"].startswith("edit 3 holds, but the answer cannot be sent")


@pytest.mark.parametrize(
    "asked",
    [{"assignments": [["exposure", [1.0]], ["sky.strength", None]]}, {"listed": ["lights.*"]}, {"listed": [""]},
     {"undo": 3}, {"configuration": "version: 1", "path": "/x/y.yaml"}, {"commands": [{"kind": "pause"}]},
     {"changes": ["views-=map"]}, {}],
)  # fmt: skip
def test_a_request_comes_back_from_its_message(asked: dict[str, Any]) -> None:
    request = EditRequest(client=1 << 33, number=7, key=KEY, **asked)
    assert request_of({**message_of(request), "id": 7}, KEY) == request
