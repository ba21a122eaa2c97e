"""Time limits of the bootstrap."""

from __future__ import annotations

import threading

import pytest

from wall.run.bootstrap import time_limit


def test_time_limit_ends_with_its_block_even_after_an_exception() -> None:
    called = threading.Event()
    with pytest.raises(ZeroDivisionError), time_limit(0.05, called.set):
        raise ZeroDivisionError
    assert not called.wait(0.2), "it would have killed a process that had long gone on"


def test_time_limit_gives_up_on_a_block_that_does_not_end() -> None:
    called = threading.Event()
    with time_limit(0.01, called.set):
        assert called.wait(5.0)
