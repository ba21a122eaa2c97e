"""However a run ends, nothing stays behind for long: no process, no socket file, no lock."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rich.table import Table
from running import (
    comes,
    mpirun,
    page_of,
    panels,
    session_of,
    shown,
    start,
    status,
    summary,
    until_written,
    wall,
    write_config,
)

from wall.commands.replay import replay

pytestmark = pytest.mark.clock
STOP_LIMIT_S = 15.0  # of a machine with much else to do; 0.5 s on one that has not
START_LIMIT_S = 60.0

ORBIT = ", path: {type: orbit, period_s: 5}"


@pytest.fixture
def running() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts runs and makes sure that none outlives the test, whatever it found."""
    started: list[subprocess.Popen[str]] = []

    def begin(*arguments: object, launcher: tuple[str, ...] = ()) -> subprocess.Popen[str]:
        started.append(start(*arguments, launcher=launcher))
        return started[-1]

    yield begin
    for run in started:
        for pid in session_of(run.pid):
            os.kill(pid, signal.SIGKILL)
        run.wait(10)


def read_until(run: subprocess.Popen[str], words: str) -> str:
    """Read what a run says until it says these words; the limit on the whole test stops one that never does."""
    assert run.stdout is not None
    said = ""
    while words not in said:
        line = run.stdout.readline()
        assert line, f"the run ended before that: {said}"
        said += line
    return said


def renderers(run: subprocess.Popen[str]) -> list[int]:
    """The process ids of a wall's renderers once it runs, in rank order, and of its nursery, if it has one."""
    read_until(run, "running (Ctrl-C")
    return renderers_of(run)


def renderers_of(run: subprocess.Popen[str]) -> list[int]:
    return session_of(run.pid)[1:]


def shared_memory_of(run: subprocess.Popen[str]) -> set[Path]:
    """Files of it that a run's processes have; of other tests' runs there may be some, too."""
    maps = [Path(f"/proc/{pid}/maps").read_text() for pid in session_of(run.pid)]
    return {Path(path) for path in re.findall(r"/dev/shm/\S+$", "".join(maps), re.MULTILINE)}


def wait_a_little() -> None:
    signal.sigtimedwait([], 0.05)


def until_gone(run: subprocess.Popen[str]) -> None:
    """Wait for the last process of a run; fails the test with what those that stay are doing."""
    limit = time.monotonic() + STOP_LIMIT_S
    while left := session_of(run.pid):
        if time.monotonic() > limit:
            threads = [task for pid in left for task in Path(f"/proc/{pid}/task").iterdir()]
            doing = {str(task): [(task / name).read_text() for name in ("comm", "wchan")] for task in threads}
            pytest.fail(f"still there after {STOP_LIMIT_S} s: {doing}")
        wait_a_little()


def test_ctrl_c_ends_a_run_in_order(tmp_path: Path, running: Callable[..., subprocess.Popen[str]]) -> None:
    config = write_config(tmp_path, columns=2, path=ORBIT)
    run = running("run", config, "--headless", "--out", tmp_path / "out")
    renderers(run)

    os.killpg(run.pid, signal.SIGINT)  # what a terminal does
    wait_a_little()
    os.killpg(run.pid, signal.SIGINT)  # and its user does not wait
    until_gone(run)

    assert run.wait(1) == 0
    assert summary(tmp_path / "out")["ended"] == "interrupted"
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "log", "panel-r0c0.png", "panel-r0c1.png", "summary.json", "wall.png",
    ]  # fmt: skip
    last = json.loads((tmp_path / "out/log/rank-0.jsonl").read_text(encoding="utf-8").splitlines()[-1])
    assert (last["level"], last["message"]) == ("info", "ended: interrupted")


def test_a_summary_that_cannot_be_written_is_one_line_and_the_images_are_there(tmp_path: Path) -> None:
    (tmp_path / "out/summary.json").mkdir(parents=True)
    run = wall("run", write_config(tmp_path), "--headless", "--seconds", 1, "--out", tmp_path / "out")
    said = "".join((run.stdout + run.stderr).split())
    assert run.returncode == 1
    assert "out/summary.json:Isadirectory" in said
    assert "Traceback" not in said
    assert (tmp_path / "out/wall.png").exists()


def test_run_of_some_seconds_ends_by_itself(tmp_path: Path) -> None:
    config = write_config(tmp_path, path=ORBIT)

    done = wall("run", config, "--seconds", 1, "--headless", "--out", tmp_path / "out")

    found = summary(tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert found["seconds"] >= 1.0
    assert found["samples_traced"] >= found["samples_shown"] > 64 * 48
    assert found["bytes"] > 64 * 48, "its own image, only what changed"
    assert [rank["role"] for rank in found["ranks"]] == ["head", "renderer"]
    assert all(rank["peak_memory"] > 0 for rank in found["ranks"])
    assert all(0 < rank["cpu_s"] < found["seconds"] * os.cpu_count() for rank in found["ranks"])
    assert found["latency_ms"]["p50"] > 0


def test_killed_renderer_does_not_stop_the_others(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config = write_config(tmp_path, columns=2, path=ORBIT)
    run = running("run", config, "--headless", "--seconds", 4, "--out", tmp_path / "out")
    first, _ = renderers(run)

    os.kill(first, signal.SIGKILL)
    output, _ = run.communicate(timeout=START_LIMIT_S)

    found = summary(tmp_path / "out")
    assert run.returncode == 1, output
    assert "rank 1 died (signal 9)" in output
    assert found["lost"].keys() == {"1"}
    assert found["ended"] == "time is up"
    assert found["ranks"][2]["samples_traced"] > 0
    assert panels(tmp_path / "out")[1].std() > 10
    assert not session_of(run.pid)


def test_killed_renderer_is_back_and_one_that_dies_too_often_is_lost(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config, events = write_config(tmp_path, path=ORBIT, restarts=1, encrypt="always"), tmp_path / "run.events"
    out = tmp_path / "out"
    run = running("run", config, "--headless", "--out", out, "--record", events)
    nursery = renderers(run)[-1]  # forked last

    def kill_renderer() -> None:
        (only,) = set(renderers_of(run)) - {nursery}
        os.kill(only, signal.SIGKILL)

    def second_life_traced() -> bool:
        written = summary(out) if (out / "summary.json").exists() else {"restarts": {}}
        return "1" in written["restarts"] and written["ranks"][1]["samples_traced"] > 64 * 48

    comes((events / "rank-1.events").exists, "the first renderer's recording", START_LIMIT_S)
    kill_renderer()
    said = read_until(run, "was started again")
    comes(second_life_traced, "samples of the second renderer in the results", START_LIMIT_S)
    kill_renderer()
    output, _ = run.communicate(timeout=START_LIMIT_S)

    found = summary(out)
    assert run.returncode == 1, output
    assert "rank 1: died (signal 9)" in said
    assert found["ended"] == "no renderer is left"
    assert len(found["restarts"]["1"]) == 1
    assert found["lost"].keys() == {"1"}
    assert found["ranks"][1]["samples_traced"] > 64 * 48, "those of the second alone"
    assert panels(out)[0].std() > 10
    assert not session_of(run.pid)
    table, last = replay(events, ranks=(), jobs=1, say=lambda line: None)
    assert isinstance(table, Table)
    assert table.row_count == 2, "both lives"
    assert "each with the bits of the run" in str(last)
    (events / "rank-1.events").unlink()  # as of a renderer that was killed before it recorded anything
    table, last = replay(events, ranks=(), jobs=1, say=lambda line: None)
    assert isinstance(table, Table)
    assert table.row_count == 1, "the second life is there all the same"


def test_a_rank_that_nothing_can_start_again_says_why(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config = write_config(tmp_path, path=ORBIT, restarts=1)
    run = running("run", config, "--headless", "--out", tmp_path / "out")
    only, nursery = renderers(run)
    os.kill(nursery, signal.SIGKILL)
    limit = time.monotonic() + START_LIMIT_S
    while Path(f"/proc/{nursery}/exe").exists():  # a zombie has none
        assert time.monotonic() < limit
        time.sleep(0.01)
    os.kill(only, signal.SIGKILL)
    output, _ = run.communicate(timeout=START_LIMIT_S)

    assert run.returncode == 1, output
    said = " ".join(output.split())
    assert "rank 1: died (signal 9; what starts ranks again had ended, signal 9) after" in said
    assert "it is not started again now" in said


def test_run_without_any_renderer_left_ends_at_once(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config = write_config(tmp_path, path=ORBIT)
    run = running("run", config, "--headless", "--out", tmp_path / "out")
    (only,) = renderers(run)

    os.kill(only, signal.SIGKILL)
    until_gone(run)

    assert run.wait(1) == 1
    assert summary(tmp_path / "out")["ended"] == "no renderer is left"


def test_frozen_renderer_is_noticed_and_welcomed_back(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config = write_config(tmp_path, columns=2, path=ORBIT, lost_after_s=1.0)
    run = running("run", config, "--headless", "--seconds", 4.5, "--out", tmp_path / "out")
    first, _ = renderers(run)
    until_written(tmp_path / "out" / "log" / "rank-1.jsonl", "takes part", START_LIMIT_S)  # unheard, it is not missed

    os.kill(first, signal.SIGSTOP)
    time.sleep(2.0)  # longer than lost_after_s
    os.kill(first, signal.SIGCONT)
    output, _ = run.communicate(timeout=START_LIMIT_S)

    found = summary(tmp_path / "out")
    assert run.returncode == 0, output
    assert found["lost"] == {}
    assert found["silences"]["1"] > 1.0
    assert found["stale_s"]["1"] > 1.0, "marked as long"


def test_killed_head_takes_its_renderers_along(tmp_path: Path, running: Callable[..., subprocess.Popen[str]]) -> None:
    config = write_config(tmp_path, columns=2, path=ORBIT, lost_after_s=1.0)
    run = running("run", config, "--headless", "--out", tmp_path / "out")
    renderers(run)

    os.kill(run.pid, signal.SIGKILL)

    until_gone(run)


@pytest.mark.mpi
def test_survivors_of_a_killed_mpi_rank_run_on_and_end_with_mpirun(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config = write_config(tmp_path, columns=2, path=ORBIT, lost_after_s=1.0)
    options = ("--with-ft", "ulfm", "--prtemca", "prte_tmpdir_base", str(tmp_path))  # what a killed mpirun leaves
    run = running("run", config, "--headless", "--out", tmp_path / "out", launcher=mpirun(3, *options))
    read_until(run, "running (Ctrl-C")
    (victim,) = (pid for pid in session_of(run.pid) if environment_of(pid).get("OMPI_COMM_WORLD_RANK") == "1")
    memory = shared_memory_of(run)

    os.kill(victim, signal.SIGKILL)
    time.sleep(2.0)  # longer than lost_after_s
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    until_gone(run)
    # by the process that writes the results, which is not of the session
    until_written(tmp_path / "out" / "summary.json", "terminated", STOP_LIMIT_S)

    found = summary(tmp_path / "out")
    assert "silent" in found["lost"]["1"]
    assert found["ended"] == "terminated"
    assert found["ranks"][2]["samples_traced"] > 0
    assert panels(tmp_path / "out")[1].std() > 10
    assert not any(file.exists() for file in memory)


@pytest.mark.mpi
def test_without_ulfm_a_rank_that_dies_ends_the_run_with_its_results(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config = write_config(tmp_path, columns=2, path=ORBIT)
    run = running("run", config, "--headless", "--out", tmp_path / "out", launcher=mpirun(3))
    read_until(run, "running (Ctrl-C")
    (victim,) = (pid for pid in session_of(run.pid) if environment_of(pid).get("OMPI_COMM_WORLD_RANK") == "1")

    os.kill(victim, signal.SIGKILL)
    until_gone(run)

    assert run.wait(1) != 0
    until_written(tmp_path / "out" / "summary.json", "terminated", STOP_LIMIT_S)


def samples_of(address: str, rank: int) -> int:
    """How many samples a rank of the run with this page has traced, as far as the head has heard."""
    return int(status(address)["totals"][rank]["samples"])


@pytest.mark.mpi
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_a_signal_to_mpirun_leaves_all_results(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]], number: signal.Signals
) -> None:
    config, out = write_config(tmp_path, path=ORBIT), tmp_path / "out"
    config.write_text(config.read_text().replace("sinks: [png]", "sinks: [browser, png]"))
    run = running("run", config, "--out", out, launcher=mpirun(2))
    address, limit = page_of(run), time.monotonic() + START_LIMIT_S
    while shown(address).std() <= 10 or samples_of(address, rank=1) <= 64 * 48:
        assert time.monotonic() < limit
        wait_a_little()
    memory = shared_memory_of(run)
    assert memory, "ranks of MPI on one machine share some"
    os.kill(run.pid, number)
    until_gone(run)
    # by the process that writes the results, which is not of the session
    until_written(out / "summary.json", "terminated", STOP_LIMIT_S)

    found = summary(out)
    assert found["ranks"][1]["samples_traced"] > 64 * 48
    assert panels(out)[0].std() > 10
    assert {path.name for path in out.iterdir()} == {"log", "panel-r0c0.png", "summary.json", "wall.png"}
    assert not any(file.exists() for file in memory)


def environment_of(pid: int) -> dict[str, str]:
    try:
        entries = Path(f"/proc/{pid}/environ").read_text().split("\0")
    except OSError:
        return {}
    return dict(entry.partition("=")[::2] for entry in entries)


def test_a_second_wall_with_the_same_results_or_recording_is_refused_and_the_first_goes_on(
    tmp_path: Path, running: Callable[..., subprocess.Popen[str]]
) -> None:
    config, out, record = write_config(tmp_path), tmp_path / "OUT", tmp_path / "run.events"
    first = running("run", config, "--headless", "--out", out, "--record", record)
    renderers(first)
    control = (out / "control.json").read_text()
    second = wall("run", config, "--headless", "--seconds", 1, "--out", out)
    assert second.returncode == 1
    assert f"another wall writes its results there (process {first.pid}" in " ".join(second.stderr.split())
    third = wall("run", config, "--headless", "--seconds", 1, "--out", tmp_path / "other", "--record", record)
    assert third.returncode == 2
    assert "a run is recorded there already" in " ".join(third.stderr.split())
    assert first.poll() is None
    assert (out / "control.json").read_text() == control
    os.kill(first.pid, signal.SIGINT)
    first.wait(STOP_LIMIT_S)
    assert wall("run", config, "--headless", "--seconds", 1, "--out", out).returncode == 0
