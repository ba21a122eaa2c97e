"""Which launched process becomes which rank: windows are where displays hang, however a host file lists machines."""

from __future__ import annotations

import pytest

from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout
from wall.run.hosts import Renumbered, assign, same_machine
from wall.run.launch import check_reached
from wall.transport.curve import KeyPair, Keys

A, B, C = "node1", "node2.site.org", "node3"


@pytest.mark.parametrize(
    ("wanted", "machines", "ranks"),
    [
        ({}, [A, B, C], (0, 1, 2)),
        ({1: "node3"}, [A, B, C], (0, 2, 1)),
        ({1: "node3", 2: "node2"}, [A, B, C, A], (0, 2, 1, 3)),
        ({1: B, 3: B}, [A, B, A, B], (0, 1, 2, 3)),  # a compositor and a renderer
        ({2: B}, [A, B, A, B], (0, 2, 1, 3)),
        ({1: A}, [A, B, A], (0, 2, 1)),  # the head is one of node1's processes already
        ({0: A, 2: B}, [A, B, B], (0, 2, 1)),
        ({1: "display1", 2: "display2"}, [A, A, A], (0, 1, 2)),  # one machine: a simulation
    ],
)
def test_ranks_go_to_the_machines_that_are_wanted_and_the_rest_in_their_order(
    wanted: dict[int, str], machines: list[str], ranks: tuple[int, ...]
) -> None:
    assert assign(wanted, machines, config="wall.yaml") == ranks


def test_a_machine_that_runs_too_few_is_refused_with_what_was_launched() -> None:
    with pytest.raises(ConfigError) as refused:
        assign({1: C, 2: C}, [A, A, C], config="wall.yaml")
    assert str(refused.value) == (
        "wall.yaml: rank 2 is wanted on node3, where no process is left; launched: 2 on node1, 1 on node3 "
        "(the first is the head)"
    )


def test_the_head_is_where_process_0_is() -> None:
    with pytest.raises(ConfigError, match="the head is wanted on node3, and process 0 runs on node1; name node3 first"):
        assign({0: C}, [A, C], config="wall.yaml")


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("node1", "node1", True),
        ("node1", "node1.site.org", True),
        ("node1.a.org", "node1.b.org", False),
        ("node1", "node2", False),
    ],
)
def test_a_name_without_its_domain_is_the_same_machine(one: str, other: str, same: bool) -> None:
    assert same_machine(one, other) is same_machine(other, one) is same


class Launched:
    """One process of three that know each other's texts."""

    def __init__(self, rank: int) -> None:
        self.rank, self.size = rank, 3
        self.killed_soon = False
        self.keys = Keys(KeyPair(f"of process {rank}", "secret"), ("of process 0", "of process 1", "of process 2"))
        self.finished = False

    def broadcast(self, text: str) -> str:
        return f"{text} of process 0"

    def dead(self) -> dict[int, str]:
        return {2: "signal 9"}

    def finish(self, *, told: bool = True) -> None:
        self.finished = True


def test_under_new_numbers_texts_and_deaths_are_those_of_the_ranks() -> None:
    launched = Launched(2)
    bootstrap = Renumbered(launched, (0, 2, 1))
    assert (bootstrap.rank, bootstrap.size) == (1, 3)
    assert bootstrap.keys.own.public == "of process 2"
    assert bootstrap.keys.ranks == ("of process 0", "of process 2", "of process 1")
    assert bootstrap.broadcast("address") == "address of process 0"
    assert bootstrap.dead() == {1: "signal 9"}
    bootstrap.finish()
    assert launched.finished


def test_ranks_on_other_machines_need_an_address_that_they_reach() -> None:
    """The head's is loopback by default, on which they would wait for ever."""
    wall = "wall: {grid: {columns: 1, rows: 1, pixels: [16, 9], size: [0.16, 0.09]}}\n"
    text = f"version: 1\nscene: {{source: spheres}}\n{wall}"
    layout = make_layout(loads(text + "views: [{id: main}]\n", name="w.yaml"))
    check_reached(layout, ["node1", "node1"])
    with pytest.raises(ConfigError, match=r"transport.bind.*only node1 can reach it, and ranks were launched on node2"):
        check_reached(layout, ["node1", "node2", "node1"])
    reached = make_layout(loads(text + "transport: {bind: 0.0.0.0}\nviews: [{id: main}]\n", name="w.yaml"))
    check_reached(reached, ["node1", "node2"])
