"""Time limits of the bootstrap, and what forked ranks inherit."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from pathlib import Path

import pytest

from wall.run.bootstrap import time_limit
from wall.run.bootstrap_local import LocalBootstrap
from wall.run.children import start_process


def test_time_limit_ends_with_its_block_even_after_an_exception() -> None:
    called = threading.Event()
    with pytest.raises(ZeroDivisionError), time_limit(0.05, called.set):
        raise ZeroDivisionError
    assert not called.wait(0.2), "it would have killed a process that had long gone on"


def test_time_limit_gives_up_on_a_block_that_does_not_end() -> None:
    called = threading.Event()
    with time_limit(0.01, called.set):
        assert called.wait(5.0)


def test_a_rank_holds_no_descriptors_of_others_however_often_ranks_are_started_again(tmp_path: Path) -> None:
    def main(bootstrap: LocalBootstrap) -> None:
        name = f"{bootstrap.rank}{bootstrap.broadcast('')}"
        part = tmp_path / f"{name}.part"
        part.write_text(str(len(os.listdir("/proc/self/fd"))))
        part.rename(tmp_path / name)
        until("end")

    def until(name: str) -> Path:
        limit = time.monotonic() + 20.0
        while not (tmp_path / name).exists():
            assert time.monotonic() < limit, name
            time.sleep(0.005)
        return tmp_path / name

    bootstrap = LocalBootstrap.start(4, main, again=True)
    bootstrap.broadcast(".first")
    counts = [int(until(f"{rank}.first").read_text()) for rank in (1, 2, 3)]
    for rank in (1, 2, 3):
        assert bootstrap.start_again(rank, ".again")
        counts.append(int(until(f"{rank}.again").read_text()))
    (tmp_path / "end").touch()
    bootstrap.finish()
    assert len(set(counts[:3])) == len(set(counts[3:])) == 1, counts


def test_files_that_a_thread_opens_meanwhile_are_not_taken_for_pipes_of_a_child() -> None:
    """A library's thread did that; the ranks forked after it died of a descriptor that they had never had."""
    ended = threading.Event()

    def open_and_close() -> None:
        while not ended.is_set():
            with open("/dev/null"), open("/dev/null"):
                pass

    thread = threading.Thread(target=open_and_close)
    thread.start()
    processes = [multiprocessing.get_context("fork").Process(target=int) for _ in range(20)]
    try:
        held = [start_process(process) for process in processes]
    finally:
        ended.set()
        thread.join()
        for process in processes:
            process.join()
    assert [len(pipes) for pipes in held] == [2] * len(processes)
    assert all(process.sentinel in dict(pipes) for process, pipes in zip(processes, held, strict=True))
