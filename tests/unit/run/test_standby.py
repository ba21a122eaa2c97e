"""What a head writes for the next one is whole, whenever it dies."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import closing
from multiprocessing import Pipe
from types import SimpleNamespace
from typing import Any

import pytest
from manager_run import TEXT, plan_of

from wall.core.errors import RunError
from wall.run import standby
from wall.run.shared_state import MOST_BYTES, SharedState
from wall.run.sinks import PageAt, make_metrics_server
from wall.run.standby import Stand, StandbyBootstrap


def left(text: str = "") -> Any:
    """What a head leaves, as far as nobody looks into it."""
    return SimpleNamespace(legacy=text)


def test_the_newest_bytes_that_were_written_to_their_end_are_read() -> None:
    state = SharedState()
    assert state.read() is None
    for text in (b"first", b"second", b"third"):
        assert state.write(text)
        assert state.read() == text
    place = state._memory.find(b"third")
    state._memory[place : place + 2] = b"fo"  # killed while it wrote the fourth there
    assert state.read() == b"second"
    assert state.write(b"fifth"), "the next head goes on writing"
    assert state.read() == b"fifth"
    assert not state.write(bytes(MOST_BYTES + 1))
    assert state.read() == b"fifth"


def test_a_user_hears_once_that_there_is_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    head = StandbyBootstrap(1, Pipe()[0], None, SharedState(), "key", "")
    said = []
    for size in (1, MOST_BYTES, MOST_BYTES, 1, MOST_BYTES):
        now += 1.0
        said.append(head.leave(lambda before, size=size: left("x" * size)))  # type: ignore[misc]
    assert [bool(each) for each in said] == [False, True, False, False, True]
    assert f"{MOST_BYTES} at most" in said[1]


@pytest.mark.parametrize("when", ["at the start", "without a head", "at the fork", "by the new head"])
def test_a_run_that_is_told_to_end_while_its_head_is_replaced_ends(when: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def head(bootstrap: StandbyBootstrap) -> str:
        if not bootstrap.how and when != "at the start":
            bootstrap.leave(lambda before: left())
            os.kill(os.getpid(), signal.SIGKILL)
        if when == "by the new head":  # which has not begun to listen
            os.kill(os.getppid(), signal.SIGTERM)
        time.sleep(2.0)
        return "went on"

    stand = Stand(1, lambda bootstrap: None, head, encrypted=False, patience_s=60.0)
    begin, replace = stand._begin, stand._replace

    def told_and(go_on: Any, how: str) -> None:
        if bool(how) == (when != "at the start"):
            os.kill(os.getpid(), signal.SIGTERM)
        go_on(how)

    if when == "without a head":
        monkeypatch.setattr(stand, "_replace", lambda how: told_and(replace, how) if "9" in how else replace(how))
    elif when != "by the new head":
        monkeypatch.setattr(stand, "_begin", lambda how: told_and(begin, how))
    handler = signal.getsignal(signal.SIGTERM)
    with pytest.raises(RunError, match="terminated before"):
        stand.run()
    assert signal.getsignal(signal.SIGTERM) is handler
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_a_signal_that_another_thread_takes_ends_the_run_too() -> None:
    def head(bootstrap: StandbyBootstrap) -> str:
        time.sleep(4.0)
        return "went on"

    def take() -> None:
        time.sleep(0.3)  # by then the run waits for its head; taken any earlier the signal is seen on the way there
        signal.pthread_kill(threading.get_ident(), signal.SIGTERM)

    thread = threading.Thread(target=take)
    thread.start()
    with pytest.raises(RunError, match="terminated before"):
        Stand(1, lambda bootstrap: None, head, encrypted=False, patience_s=60.0).run()
    thread.join()


def run_with(head: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What comes of a run without other ranks, whose head may stand still for half a second."""
    monkeypatch.setattr(standby, "AWAKE_S", 0.2)
    return Stand(1, lambda bootstrap: None, head, encrypted=False, patience_s=1.0).run()


@pytest.mark.parametrize("size", [1, MOST_BYTES], ids=["", "and has no room for what it leaves"])
def test_a_head_that_stands_still_is_replaced_and_one_that_is_slow_or_ending_is_not(
    monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    def head(bootstrap: StandbyBootstrap) -> str:
        if bootstrap.how:
            time.sleep(1.0)  # before it says anything
        bootstrap.leave(lambda before: left())
        if not bootstrap.how:
            os.kill(os.getpid(), signal.SIGSTOP)
        for _ in range(10):
            time.sleep(0.1)
            bootstrap.leave(lambda before: left("x" * size))
        bootstrap.end()
        time.sleep(1.0)
        return bootstrap.how

    assert run_with(head, monkeypatch) == "died (signal 9 after it had done nothing for 0.5 s)"


def test_a_head_that_stands_still_soon_after_another_one_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def head(bootstrap: StandbyBootstrap) -> str:
        bootstrap.leave(lambda before: left())
        os.kill(os.getpid(), signal.SIGSTOP)
        return "went on"

    with pytest.raises(RunError, match=r"done nothing for 0\.5 s.*no other one takes its place"):
        run_with(head, monkeypatch)


def test_a_head_that_dies_while_it_ends_the_run_is_not_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    def head(bootstrap: StandbyBootstrap) -> str:
        bootstrap.leave(lambda before: left())
        bootstrap.end()
        os.kill(os.getpid(), signal.SIGKILL)
        return "went on"

    with pytest.raises(RunError, match="no other one takes its place"):
        run_with(head, monkeypatch)


def test_metrics_stay_at_their_address_with_their_tokens() -> None:
    plan = plan_of(TEXT + "output: {metrics: 0, browser: {token: always}}\n")
    before = None
    for _ in range(2):
        server = make_metrics_server(plan, before)
        assert server is not None
        with closing(server):
            here = PageAt(server.address, server.tokens)
            assert before in (None, here)
            before = here
