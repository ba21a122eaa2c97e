"""Renderers that share a core: one at a time, whatever becomes of one that has its turn."""

from __future__ import annotations

from copy import copy
from threading import Thread

import pytest

from wall.core.clock import ManualClock
from wall.run import turns
from wall.run.turns import HELD_S, Turns


def both() -> tuple[Turns, Turns, ManualClock]:
    """As two processes have it that were forked after it was made."""
    clock = ManualClock()
    one = Turns(clock.now)
    return one, copy(one), clock


def may_begin(other: Turns, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether nobody has a turn; then it is the other's."""
    with monkeypatch.context() as patch:
        patch.setattr(turns, "LONGEST_S", 0.0)
        return other.begin()


def test_who_waits_goes_on_when_the_other_has_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns, "LONGEST_S", 60.0)
    one, other, _ = both()
    said: list[str] = []

    one.begin()
    waiting = Thread(target=lambda: (other.begin(), said.append("the other")))
    waiting.start()
    waiting.join(0.05)
    said.append("one")
    one.end()
    waiting.join(60.0)

    assert said == ["one", "the other"]


def test_a_turn_is_held_for_a_while_where_an_image_is_to_be_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other, clock = both()
    one.begin()
    one.end(hold=True)
    assert not may_begin(copy(other), monkeypatch)

    clock.advance(HELD_S)
    one.begin()
    one.end(hold=True)
    assert may_begin(other, monkeypatch)


def test_one_that_never_ends_its_turn_holds_up_the_others_once(monkeypatch: pytest.MonkeyPatch) -> None:
    dead, other, _ = both()
    third = copy(other)
    dead.begin()

    assert not may_begin(other, monkeypatch)
    other.end()
    assert may_begin(third, monkeypatch)
    third.end()


def test_one_that_ends_its_turn_late_makes_no_second_one(monkeypatch: pytest.MonkeyPatch) -> None:
    late, other, _ = both()
    late.begin()
    assert not may_begin(other, monkeypatch)
    other.end()
    late.end()

    assert may_begin(other, monkeypatch)
    assert not may_begin(late, monkeypatch)
