"""Ranks that died are told of once, and started again so often in a minute."""

from __future__ import annotations

from wall.roles.instructions import Died
from wall.run.deaths import RESTARTS_WITHIN_S, Deaths

DEAD = {2: "signal 9"}


def test_a_rank_that_dies_too_often_is_told_of_once_and_started_again_when_its_first_start_is_a_minute_old() -> None:
    lives: list[int] = []

    def start(rank: int, life: int) -> bool:
        lives.append(life)
        return True

    deaths = Deaths(start)

    def news(now: float) -> list[Died]:
        return list(deaths.news(DEAD, 2, now))

    again, for_now = Died(2, "signal 9", again=True), Died(2, "signal 9")
    assert [news(10.0), news(20.0), news(30.0), news(31.0)] == [[again], [again], [for_now], []]
    assert news(9.9 + RESTARTS_WITHIN_S) == []
    assert news(10.0 + RESTARTS_WITHIN_S) == [again]
    assert lives == [1, 2, 3]
    assert list(deaths.news({}, 2, 90.0)) == []
    assert news(91.0) == [again], "the start at 20 s is too old to count"


def test_a_rank_that_cannot_be_started_again_is_told_of_each_time_it_dies() -> None:
    deaths = Deaths(lambda rank, life: False)
    assert list(deaths.news(DEAD, 3, 1.0)) == [Died(2, "signal 9")]
    assert list(deaths.news(DEAD, 3, 1.0)) == []
    assert list(deaths.news({}, 3, 2.0)) == []
    assert list(deaths.news(DEAD, 3, 3.0)) == [Died(2, "signal 9")]
