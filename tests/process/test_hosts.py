"""A wall on three hosts, made of namespaces: the same picture, whatever is done to their network."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from running import comes, page_of, panels, shown, start, status, summary, until, until_written, write_config

from wall.client import connect
from wall.config.loading import load
from wall.core.errors import RunError
from wall.roles.plan import make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.study.faults.hosts import Hosts
from wall.study.faults.intrusion import stranger, turn
from wall.tracing.tracer_scene import make_tracer_scene

pytestmark = [pytest.mark.clock, pytest.mark.mpi]
PORTS = "9000-9100"
PATIENCE_S = 20.0  # of a busy machine
SLOW_BITS_S = 100_000  # a panel takes two seconds


@pytest.fixture
def hosts(tmp_path: Path) -> Iterator[Hosts]:
    try:
        made = Hosts(3, tmp_path / "hosts")
    except RunError as error:
        pytest.skip(str(error))
    yield made
    made.close()


def test_a_wall_of_three_hosts_outlives_a_cut_bad_links_and_a_dead_rank(tmp_path: Path, hosts: Hosts) -> None:
    config, out = write_config(tmp_path, columns=2, lost_after_s=0.5), tmp_path / "out"
    text = config.read_text().replace("transport:\n  {", f"transport:\n  {{bind: 0.0.0.0, ports: {PORTS}, ")
    config.write_text(text.replace("[png]", "[browser, png]"))
    run = start("run", config, "--still", "--out", out, launcher=tuple(hosts.mpirun(3, "--with-ft", "ulfm")))
    try:
        address = hosts.page(page_of(run))

        def alive() -> list[bool]:
            return [rank["alive"] for rank in status(address)["ranks"]]

        def of_left(picture: NDArray[np.int16]) -> NDArray[np.int16]:
            return picture[:, :64]

        home = until(address, np.zeros(1), changes=False)
        control = json.loads((out / "control.json").read_text())
        assert re.match(r"tcp://10\.77\.0\.1:90\d\d$", control["endpoint"])
        assert control["head"], "CURVE"
        with connect(address, patience_s=PATIENCE_S) as wall:
            hosts.cut("h3")
            comes(lambda: alive() == [True, True, False], "silence")
            time.sleep(2.0)  # four times lost_after_s: no reason to end
            wall.set({"sky.zenith": [0.9, 0.1, 0.1]})
            half = until(address, home)
            assert np.array_equal(half[:, -64:], home[:, -64:]), "no sample of it came"
            hosts.join("h3")
            red = until(address, half)
            assert not np.array_equal(red[:, -64:], home[:, -64:])
            assert np.array_equal(of_left(red), of_left(half))
            comes(lambda: all(alive()), "samples, and heartbeats")

            hosts.slow("h3", SLOW_BITS_S)
            wall.undo()
            comes(lambda: np.array_equal(of_left(shown(address)), of_left(home)), "the other panel as before")
            comes(lambda: np.array_equal(shown(address), home), "all of it as before")
            hosts.speed_up("h3")

            hosts.degrade("h3", loss=0.02, delay_s=0.02)
            wall.set({"sky.zenith": [0.1, 0.1, 0.9]})
            blue = until(address, home)
            comes(lambda: not np.array_equal(shown(address)[:, -64:], home[:, -64:]), "samples over a lossy link")
            wall.undo()
            assert not np.array_equal(of_left(blue), of_left(home))
            comes(lambda: np.array_equal(shown(address), home), "all of it as before, whatever was lost")
            hosts.repair("h3")

        comes(lambda: all(alive()), "samples, and heartbeats")
        with stranger(hosts, PORTS) as somebody:
            turn(somebody, "connect", list(hosts.ranks().values()))
        comes(lambda: all(alive()), "samples, and heartbeats")

        os.kill(hosts.ranks()[1], signal.SIGKILL)
        comes(lambda: alive() == [True, False, True], "a death")
        assert np.array_equal(shown(address), home)
        until_written(out / "log" / "rank-1.jsonl", "silent for", PATIENCE_S)
    finally:
        run.send_signal(signal.SIGTERM)
        said = run.communicate(timeout=20)[0]
        print(said)
    until_written(out / "summary.json", "terminated", PATIENCE_S)
    assert "rank 2: is heard again" in said
    found = summary(out)
    assert found["lost"].keys() == {"1"}
    assert found["silences"]["2"] > 1.5
    assert [rank["host"] for rank in found["ranks"]] == ["h1", "h2", "h3"]
    plan = make_plan(make_layout(load(config)))
    alone = SingleProcess(plan, make_tracer_scene(plan.scene)).until_complete()
    for ours, theirs in zip(panels(out), sorted(alone, key=lambda image: image.id), strict=True):
        assert np.array_equal(ours, theirs.rgb)
    comes(lambda: not any(map(hosts.processes, ("h2", "h3"))), "the end of all ranks")
