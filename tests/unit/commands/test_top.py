"""A run as another terminal sees it: what its server says, and when it is gone."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from wall.commands.terminal import Terminal
from wall.commands.top import TRIES, Wall, top
from wall.core.errors import ConfigError, RunError
from wall.display.base import RankStatus, RankTotals, Status
from wall.display.gate import Access
from wall.display.metrics_server import MetricsServer
from wall.run.control_file import Control, announced

TOKEN = "sixteen-letters-0"


def status(seconds: float, cpu_s: float) -> Status:
    ranks = tuple(
        RankStatus(
            rank=k, role="renderer", panel="p", region="p\x1b[31m", samples_per_s=2e6, bytes_per_s=0.0,
            oldest_sample_s=None, dropped=k, alive=k == 0, memory_mb=1.0,
        )
        for k in range(2)
    )  # fmt: skip
    totals = RankTotals(host="node7", seconds=seconds, cpu_s=cpu_s, memory=64 << 20)
    return Status(
        seconds=90061.0, paused=False, sampler="", samplers=(), ranks=ranks, latency_ms=(0.0, 0.0, 0.0),
        latencies_ms=(), refreshes_per_s=30.0, notes=("rank 1: died",),
        totals=(totals, replace(totals, seconds=0.0, dropped={"late": 3})),
    )  # fmt: skip


@pytest.fixture
def server() -> Iterator[MetricsServer]:
    with closing(MetricsServer("127.0.0.1", 0, access=Access(tokens=True, watch_token=TOKEN))) as made:
        made.tell(status(10.0, 4.0))
        yield made


def test_one_table_has_every_rank_and_the_cores_of_the_time_between(server: MetricsServer) -> None:
    out = io.StringIO()
    later = status(12.0, 7.0)
    wall = Wall(server.address.replace("/metrics", "/"))
    top(wall, Terminal(file=out, width=200), every_s=2.0, once=True, sleep=lambda s: server.tell(later))
    lines = [line.split() for line in out.getvalue().splitlines()]
    assert lines[0][1:7] == ["1", "d", "1:01:01", "1", "of", "2"]
    assert lines[2] == ["0", "renderer", "p\\x1b[31m", "node7", "2", "M", "0", "0.0", "s", "0", "64", "MB", "1.50"]
    assert lines[3][-1] == "MB", "a rank that was not heard of has used no known time"
    assert [" ".join(words) for words in lines[4:]] == ["dropped: rank 1: late 3", "rank 1: died"]


def test_a_region_of_several_views_takes_several_lines_on_a_narrow_terminal(server: MetricsServer) -> None:
    region = "main p 160x120+0+0, top p 40x30+3+5, close p 60x33+88+70"
    out, now = io.StringIO(), status(12.0, 7.0)
    server.tell(replace(now, ranks=tuple(replace(rank, region=region) for rank in now.ranks)))
    wall = Wall(server.address.replace("/metrics", "/"))
    top(wall, Terminal(file=out, width=80), every_s=2.0, once=True, sleep=lambda s: None)
    lines = out.getvalue().splitlines()
    assert "\u2026" not in out.getvalue()
    assert all(word in " ".join(" ".join(lines).split()) for word in (*region.split(), "samples/s", "memory", "64 MB"))


def test_a_wall_is_found_by_its_folder_of_results(server: MetricsServer, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no such file"):
        Wall(str(tmp_path))
    control = Control(endpoint="tcp://x:1", key="k", head="", host="h", pid=1)
    with announced(tmp_path, control), pytest.raises(RunError, match="has no page"):
        Wall(str(tmp_path))
    with announced(tmp_path, replace(control, page=server.address)):
        assert Wall(str(tmp_path)).status() is not None


def test_a_run_that_ends_is_said_to_be_gone(server: MetricsServer) -> None:
    out, slept = io.StringIO(), list[float]()

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        if len(slept) == 2:
            server.close()

    with pytest.raises(RunError, match="the run is gone, or cannot be reached any more"):
        top(
            Wall(server.address), Terminal(file=out, width=200, force_terminal=True), every_s=1, once=False, sleep=sleep
        )
    assert len(slept) == 1 + TRIES
    assert "no answer: " in out.getvalue()


def test_who_has_no_token_or_finds_something_else_is_told_so(server: MetricsServer) -> None:
    with pytest.raises(RunError, match="refuses: this page needs a token"):
        Wall(server.address.partition("?")[0]).status()
    server.tell(None)  # type: ignore[arg-type]  # as before the first image
    assert Wall(server.address).status() is None
    for address in ("ftp://node7/", "http://", "http://node7:99999/", "//"):
        with pytest.raises(ConfigError, match="no address of a page"):
            Wall(address)
