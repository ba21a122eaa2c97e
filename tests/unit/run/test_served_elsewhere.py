"""What people, and `control.json`, are told of a page that another compositor serves."""

from __future__ import annotations

import socket
from dataclasses import replace

import pytest

from wall.core.errors import RunError
from wall.packets.control import Hello
from wall.run.served_elsewhere import ServedElsewhere

HERE = Hello(rank=1, host=socket.gethostname(), endpoint="", incarnation=1, page="http://127.0.0.1:8800/")
THERE = replace(HERE, host="edge", page="https://edge:8800/?token=a", watch="https://edge:8800/?token=b")


class Told:
    """One that looks, and all that it tells."""

    def __init__(self, *servers: Hello | None, announces: bool = True, fails: bool = False) -> None:
        self.said, self.opened, self.written, self._fails = list[str](), list[str](), list[str](), fails
        coming = iter(servers)
        looks = ServedElsewhere(lambda: next(coming), self.said.append, self.opened.append, announces=announces)
        looks.write = self._write
        for _ in servers:
            looks.look()

    def _write(self, address: str) -> None:
        if self._fails:
            raise RunError("no room")
        self.written.append(address)


def test_a_page_of_this_host_is_opened_once_and_its_next_address_is_told() -> None:
    again = replace(HERE, incarnation=2, page="http://127.0.0.1:9900/")
    told = Told(None, HERE, HERE, again)
    assert told.opened == [HERE.page]
    assert told.said == [f"note: {HERE.host} serves the page at {again.page}"]
    assert told.written == [HERE.page, again.page]


def test_of_another_host_people_are_told_where_and_how_to_watch() -> None:
    told = Told(THERE)
    assert told.opened == [""], "the wall runs"
    assert told.said == [
        f"note: edge serves the page at {THERE.page}",
        f"note: to watch the wall without steering it: {THERE.watch}",
    ]
    assert told.written == [THERE.page]


def test_an_address_that_is_another_host_s_own_is_in_no_file() -> None:
    told = Told(replace(HERE, host="edge"))
    assert (told.written, len(told.said)) == ([], 1)


def test_a_head_that_took_over_announces_nothing_anew() -> None:
    assert Told(HERE, announces=False).opened == []


def test_a_file_that_cannot_be_written_ends_nothing() -> None:
    told = Told(HERE, fails=True)
    assert (told.opened, told.said) == ([HERE.page], ["note: no room"])


@pytest.mark.parametrize("page", ["file:///etc/passwd", "javascript:x", "8800"])
def test_what_is_no_address_of_a_page_is_not_told(page: str) -> None:
    told = Told(replace(HERE, page=page))
    assert (told.opened, told.said, told.written) == ([], [], [])
