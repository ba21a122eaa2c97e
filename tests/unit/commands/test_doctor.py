"""What a machine lacks is found, within its time, and said with what mends it."""

from __future__ import annotations

import os
import resource
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wall import cli
from wall.commands.doctor import machine, network
from wall.commands.doctor.doctor import clock_offsets
from wall.commands.doctor.finding import Check, Finding, findings
from wall.config.loading import loads
from wall.core.errors import RunError
from wall.roles.plan import Layout, make_layout

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
"""


def layout_of(text: str = "") -> Layout:
    return make_layout(loads(TEXT + text, path=Path("wall.yaml")))


@pytest.fixture
def taken() -> Iterator[int]:
    """A port at which something listens."""
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        yield server.getsockname()[1]


def test_a_check_that_hangs_or_fails_is_missing_with_what_mends_it_and_the_next_one_runs() -> None:
    forever = threading.Event()

    def hangs() -> Iterator[Finding]:
        forever.wait()
        yield Finding(name="", state="ok", found="")

    def fails() -> Iterator[Finding]:
        raise RunError("no such display")

    def works() -> Iterator[Finding]:
        yield Finding(name="works", state="ok", found="all")

    checks = [Check("hangs", hangs, limit_s=0.05, mend="wait"), Check("fails", fails, mend="buy"), Check("w", works)]
    found = [(each.name, each.state, each.found, each.mend) for each in findings(checks)]
    forever.set()
    assert found == [
        ("hangs", "missing", "no answer within 0.05 s", "wait"),
        ("fails", "missing", "no such display", "buy"),
        ("works", "ok", "all", ""),
    ]


@pytest.mark.parametrize(
    ("there", "wanted", "good"),
    [
        ("2.10.1", ">=2.9,<3", True), ("3.0", ">=2.9,<3", False), ("2.8.9", ">=2.9,<3", False), ("1", "", True),
        ("4.4.0.post1", "==4.4.0.post1", True), ("4.3.0", "==4.4.0.post1", False),
    ],
)  # fmt: skip
def test_versions_are_compared_by_their_numbers(there: str, wanted: str, good: bool) -> None:
    assert machine.satisfies(there, wanted) is good


def test_this_installation_has_all_its_packages() -> None:
    assert [(each.name, each.state) for each in machine.packages()] == [("python", "ok"), ("extras", "ok")]


def test_an_extra_that_is_not_there_is_named_with_what_it_is_for(monkeypatch: pytest.MonkeyPatch) -> None:
    there = machine.version

    def version(name: str) -> str:
        if name == "vtk":
            raise PackageNotFoundError(name)
        return there(name)

    monkeypatch.setattr(machine, "version", version)
    (extras,) = [each for each in machine.packages() if each.name == "extras"]
    assert extras.found.startswith("data: no vtk, which reads VTK's files (pip install 'wall[data]'), film: av ")


@contextmanager
def neighbour_of(taken: int) -> Iterator[int]:
    """The port above or below one, at which something listens, too: this, or another program."""
    with ExitStack() as closing_later:
        with suppress(OSError):
            closing_later.enter_context(closing(socket.create_server(("127.0.0.1", taken - 1))))
        yield taken - 1


def test_ports_are_counted_against_what_one_machine_may_need(taken: int) -> None:
    def state(first: int, last: int) -> str:
        [found] = network.ports(layout_of(f"transport: {{ports: {first}-{last}}}"))
        return found.state

    [elsewhere] = network.ports(layout_of("transport: {bind: 10.255.255.1}"))
    with neighbour_of(taken) as other:
        assert state(*sorted((taken, other))) == "missing"
    assert elsewhere.state == "missing"
    [free] = network.ports(layout_of())
    assert free.state == "ok"


def test_a_page_that_cannot_be_served_is_found_before_the_run(taken: int, tmp_path: Path) -> None:
    page, metrics = network.page(layout_of(f"output: {{metrics: {taken}, browser: {{port: 0}}}}"))
    assert (page.state, metrics.state) == ("ok", "missing")
    assert "output.metrics" in metrics.mend
    with pytest.raises(RunError, match="watch_token"):
        list(network.page(layout_of(f"output: {{browser: {{watch_token: {tmp_path}/none}}}}")))


def test_limits_of_the_machine_are_compared_with_what_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda which: (100, 4096))
    [few] = machine.open_files(5)
    assert (few.state, few.mend) == ("missing", "ulimit -n 168")
    [too_small] = machine.shared_memory(1 << 60)
    assert too_small.state == "warning"
    [some], [many] = machine.cores(1), machine.cores(1 << 20)
    assert (some.state, many.state) == ("ok", "warning")
    [unknown] = machine.shared_memory(0)
    assert "needed" not in unknown.found


def test_under_mpirun_the_cores_of_the_machine_are_told_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {3})
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "5")
    [bound] = machine.cores(5)
    said = "1 that this process may use, for 5 ranks, of 8: mpirun may have bound it to some (--bind-to none)"
    assert (bound.state, bound.found) == ("warning", said)


def test_an_mpirun_that_does_not_start_ranks_is_said_with_its_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert [each.state for needed in (True, False) for each in machine.mpi(needed=needed)] == ["missing", "warning"]
    program = tmp_path / "mpirun"
    program.write_text("#!/bin/sh\necho no slots left >&2\nexit 1\n")
    program.chmod(0o755)
    [broken] = machine.mpi(needed=True)
    assert broken.state == "missing"
    assert "no slots left" in broken.found
    program.write_text("#!/bin/sh\necho \"['here', 'here']\"\necho \"['here', 'here']\"\n")
    [works] = machine.mpi(needed=True)
    assert works.state == "ok"


class Ahead:
    """Two ranks, of which the other's clock is 5 s ahead."""

    rank = 0

    def allgather(self, text: str) -> list[str]:
        return [text, repr(float(text) + 5.0) if "." in text else text]


def test_clocks_of_hosts_are_compared_with_that_of_rank_0() -> None:
    (own, _), (other, within_s) = clock_offsets(Ahead())
    assert own == 0.0
    assert other == pytest.approx(5.0)
    assert within_s >= 0.0


def test_the_command_ends_with_1_if_something_is_missing_and_0_if_not(
    tmp_path: Path, taken: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "mpi", lambda *, needed: [])  # they start processes, and have tests of their own
    monkeypatch.setattr(machine, "gpu", lambda *, needed: [])
    good, bad = tmp_path / "good.yaml", tmp_path / "bad.yaml"
    good.write_text(TEXT)
    bad.write_text(TEXT + f"output: {{metrics: {taken}}}\n")
    done = [CliRunner().invoke(cli.app, ["doctor", str(file), "--out", str(tmp_path)]) for file in (good, bad)]
    assert [each.exit_code for each in done] == [0, 1]
    assert "missing metrics" in done[1].output
    assert "mend: another port in output.metrics" in done[1].output
