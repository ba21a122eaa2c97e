"""Signals that end a run, and results that are written before the process is killed."""

from __future__ import annotations

import os
import signal
from concurrent.futures import thread as executors
from pathlib import Path

import pytest

from wall.run.endings import REASONS, EndSignals, WriterApart


@pytest.mark.parametrize("number", list(REASONS))
def test_signal_gives_its_reason_as_often_as_it_comes(number: signal.Signals, as_in_a_terminal: None) -> None:
    before = [signal.getsignal(each) for each in REASONS]
    reasons: list[str] = []
    signals = EndSignals(reasons.append)
    signals.install()
    try:
        for _ in range(2):
            os.kill(os.getpid(), number)
    finally:
        signals.restore()
    assert reasons == [REASONS[number]] * 2
    assert [signal.getsignal(each) for each in REASONS] == before


def test_hang_up_that_the_process_was_started_to_ignore_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    reasons: list[str] = []
    signals = EndSignals(reasons.append)
    try:
        signals.install()
        os.kill(os.getpid(), signal.SIGHUP)
        signals.restore()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signals.restore()
        signal.signal(signal.SIGHUP, before)
    assert reasons == []


def test_results_are_written_by_a_process_outside_the_group_that_is_killed(tmp_path: Path) -> None:
    results = ["as they are"]

    def write() -> None:
        (tmp_path / "results").write_text(f"{os.getpid()} {os.getpgrp()} {results[0]}")

    apart = WriterApart(write)
    apart.begin()
    results[0] = "newer"
    apart.begin()
    apart.wait()
    pid, group, text = (tmp_path / "results").read_text().split(maxsplit=2)
    assert pid == group != str(os.getpgrp())
    assert text == "as they are"


def test_writer_that_fails_ends_nothing_else(tmp_path: Path) -> None:
    apart = WriterApart((tmp_path / "missing" / "file").touch)
    apart.begin()
    apart.wait()


def test_a_signal_amid_a_task_that_is_handed_to_a_thread_writes_once_that_is_done(tmp_path: Path) -> None:
    """Then this thread holds a lock that a fork waits for."""
    apart = WriterApart((tmp_path / "file").touch)
    with executors._global_shutdown_lock:
        apart.begin()
    apart.wait()
    assert (tmp_path / "file").exists()
