from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from plan_rates import RATES

from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.roles.compositor import Compositor
from wall.roles.plan import make_layout, make_plan
from wall.study.plan.comparison import figures_of, with_renderers
from wall.study.plan.engine import WEIGHTS, Cores, Engine, Task
from wall.study.plan.network import Costs, Machine, Network, Process, SimulatedHub, SimulatedLink
from wall.study.plan.scenarios import HOPS, simulate
from wall.study.plan.simulation import Setting, Simulation
from wall.study.plan.walls import THOUSAND, config_of

CONFIGS = Path(__file__).parents[3] / "configs"
FREE = Costs(message_s=0.0, event_send_s=0.0, event_s=0.0, packet_s=0.0)


def plan_of(count, name="sampler_adaptive.yaml"):
    return make_plan(make_layout(with_renderers(load(CONFIGS / name), count)))


def test_a_wall_with_a_border_is_compared_without():
    assert plan_of(1, "views/map_inset.yaml").layout.graph.layers


@pytest.fixture(scope="module")
def two_renderers():
    return plan_of(2)


def test_calls_come_in_the_order_of_their_times():
    engine, came = Engine(), []
    for time in (3.0, 1.0, 2.0, 1.0):
        engine.at(time, came.append, time)
    engine.run(2.5)
    assert came == [1.0, 1.0, 2.0]


def test_tasks_share_a_core_by_their_weights():
    engine = Engine()
    cores, used = Cores(engine, 1), Counter()

    def work(nice, task):
        cores.submit(task, 1e-3, lambda: (used.update([nice]), work(nice, task)))

    for nice in WEIGHTS:
        work(nice, Task(nice))
    engine.run(10.0)
    assert sum(used.values()) == pytest.approx(10_000, abs=5)  # the core was never idle
    # a nice task that wakes runs a little early each time, so it may have somewhat more than its weight's share
    assert used[0] / used[5] == pytest.approx(WEIGHTS[0] / WEIGHTS[5], rel=0.1)


def test_three_tasks_on_two_cores_take_as_long_as_their_work():
    engine, done = Engine(), []
    cores = Cores(engine, 2)
    for _ in range(3):
        cores.submit(Task(), 1.0, lambda: done.append(engine.now))
    engine.run(10.0)
    assert max(done) == pytest.approx(1.5, abs=0.01)  # three core seconds on two cores


def test_a_line_carries_its_bytes_a_second_from_however_many_senders():
    engine, came = Engine(), []
    network = Network(engine, bytes_per_s=1e6, latency_s=0.01)
    sender, other, receiver = (Process(engine, Machine(engine, name, 1), FREE) for name in "abc")
    for source in (sender, other):
        network.send(source, receiver, 10_000 - 78, lambda: came.append(engine.now))
    engine.run(1.0)
    assert came == [pytest.approx(0.02), pytest.approx(0.03)]  # 10 ms of latency, 10 ms of bytes each, in turn


def test_no_more_bytes_are_under_way_than_the_real_credit_grants():
    engine = Engine()
    network = Network(engine, bytes_per_s=1e9, latency_s=1e-3)
    here, there = (Process(engine, Machine(engine, name, 1), FREE) for name in "ab")
    hub = SimulatedHub(network, there, credit_bytes=10_000)
    link = SimulatedLink(network, here, hub.endpoint)
    engine.run(0.1)
    dropped = sum(len(link.offer(bytes(4000))) for _ in range(9))
    engine.run(0.2)
    taken = hub.drain(1 << 20)
    assert len(taken) == 2  # 8,000 of 10,000 bytes
    assert dropped == 5  # two wait for credit, the others gave way
    for peer, packet in taken:
        hub.release(peer, len(packet))
    engine.run(0.3)
    assert link.credit.sent == 8000
    assert link.offer(bytes(1)) == [bytes(4000)] or link.credit.sent > 8000


def test_a_simulation_is_the_same_each_time(two_renderers):
    setting = Setting(cores=2, one_machine=True, seconds=1.0)
    first, second = (Simulation(two_renderers, RATES, setting).run() for _ in range(2))
    assert replace(first, took_s=0.0) == replace(second, took_s=0.0)


def test_renderers_with_a_core_each_trace_as_fast_as_their_costs_allow(two_renderers):
    rates = replace(RATES, replan_pixel_s=0.0, aim_s=0.0, turn_s=0.0, event_s=0.0, packet_s=0.0, message_s=0.0)
    found = Simulation(two_renderers, rates, Setting(cores=4, seconds=2.0)).run()
    assert found.samples_per_s == pytest.approx(2 * 2048 / 2e-3, rel=0.01)
    assert found.packets_per_s == pytest.approx(2 / 2e-3, rel=0.01)
    assert found.refreshes_per_s == pytest.approx(30.0, rel=0.05)
    assert found.lost == 0


def test_a_run_ends_as_a_real_one_and_uses_no_more_than_its_cores():
    simulation = Simulation(plan_of(8), RATES, Setting(cores=2, one_machine=True, seconds=2.0))
    simulation.run()
    summary = simulation.finish()
    assert summary["ended"] == "time is up"
    assert summary["lost"] == {}
    assert 2.0 < summary["seconds"] < 4.0
    assert sum(node.task.used for node in simulation.nodes) <= 2 * summary["seconds"]
    assert figures_of(summary).samples_per_s == pytest.approx(2048 * figures_of(summary).packets_per_s, rel=0.05)


def test_a_slow_line_limits_the_samples_that_come(two_renderers):
    found = Simulation(two_renderers, RATES, Setting(cores=4, seconds=2.0, link_bytes_per_s=1e6)).run()
    assert found.bytes_per_s <= 1.05e6  # by credit: the compositor's line carries 1 MB/s
    assert found.busiest_in_bytes_per_s == pytest.approx(1e6, rel=0.05)


def test_framelets_of_a_compositor_tree_reach_the_head():
    plan = make_plan(make_layout(load(CONFIGS / "graphs" / "compositor_tree.yaml")))
    simulation = Simulation(plan, RATES, Setting(cores=2, seconds=2.0))
    found = simulation.run()
    head = simulation.nodes[1].loop.role
    assert isinstance(head, Compositor)
    assert head.composition.layers == {}  # the compositors before it have them
    assert head.composition.newest_event()[0] > 50  # of 80 events in 2 s
    assert len(head.latency.seconds) > 50
    assert found.dropped.get("framelet_dropped", 0) == 0


def test_hops_add_up_to_the_way_of_an_event(two_renderers):
    run = simulate(two_renderers, RATES, Setting(cores=4, seconds=1.0), name="test")
    whole = [trip.shown - trip.input for trip in run.outcome.trips]
    assert len(run.hops_s) == len(HOPS)
    assert sum(run.hops_s) == pytest.approx(sum(whole) / len(whole))
    assert all(seconds >= 0.0 for seconds in run.hops_s)


def test_the_texts_walls_have_their_pixels_and_a_thousand_ranks():
    dealt = THOUSAND[0]
    layout = make_layout(config_of(dealt))
    assert layout.size == 1000
    pixels = sum(panel.pixels[0] * panel.pixels[1] for panel in layout.wall.panels)
    assert pixels == pytest.approx(dealt.target.pixels, rel=0.01)
    for other in THOUSAND[1:]:
        assert other.columns * other.rows * (1 + other.ranks_per_panel) == 1000
        assert other.columns * other.rows * other.pixels[0] * other.pixels[1] == pytest.approx(
            other.target.pixels, rel=0.01
        )


def test_what_is_not_simulated_is_refused():
    with pytest.raises(ConfigError, match="lock step is not simulated"):
        Simulation(make_plan(make_layout(load(CONFIGS / "graphs" / "lock_step.yaml"))), RATES, Setting(cores=2))
