"""The simulated tracker: what it sends is what the configuration reads, of a sway or of a recorded movement."""

from __future__ import annotations

import itertools
import socket
from pathlib import Path

import numpy as np
import pytest

from wall.commands import tracker
from wall.config.loading import load, loads
from wall.config.tracking import TrackingConfig
from wall.core.errors import ConfigError
from wall.geometry.tracking import wall_from_tracker
from wall.packets.osc import positions

SHIPPED = Path(__file__).parents[3] / "configs" / "tracked.yaml"
TOLD = TrackingConfig(metres_per_unit=0.01, axes=("-x", "z", "y"), origin=(0.0, -1.0, 0.0), first=2, address="/body/1")


def test_packets_sent_to_a_port_tell_the_movement_in_the_tracker_s_words() -> None:
    movement = tracker.sway(np.array([0.0, 0.1, 1.2]))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wall:
        wall.bind(("127.0.0.1", 0))
        wall.settimeout(10.0)
        sent = tracker.packets(TOLD, movement, rate=1000.0, noise_m=0.0)
        assert tracker.send(sent, wall.getsockname(), rate=1000.0, seconds=0.02) == 20
        came = [wall.recv(2048) for _ in range(20)]

    for k, data in enumerate(came):
        [told] = positions(data, "/body/1", 2)
        np.testing.assert_allclose(wall_from_tracker(TOLD, told), movement(k / 1000.0), atol=1e-6)


def test_a_recorded_movement_is_straight_between_its_lines_and_starts_over(tmp_path: Path) -> None:
    file = tmp_path / "walk.csv"
    file.write_text("time,x,y,z\n2,0,0,1\n3,0.5,0,1\n4,0.5,0.2,1\n")
    movement = tracker.recorded(file)

    for seconds, wanted in ((0.5, (0.25, 0.0, 1.0)), (1.5, (0.5, 0.1, 1.0)), (2.5, (0.25, 0.0, 1.0))):
        np.testing.assert_allclose(movement(seconds), wanted)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0,0,0,1\n", "1 positions; want two"),
        ("0,0,0,1\n1,0,0\n", ":2: .*want time, x, y, z"),
        ("0,0,0,1\n1,nan,0,0\n", ":2: .*want time, x, y, z"),
        ("1,0,0,1\n1,0,0,0\n", ":2: time 1: want times"),
        ("0,0,0,1\n1,far,0,0\n", ":2: could not convert"),
    ],
)
def test_a_file_of_another_kind_is_refused(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "walk.csv"
    file.write_text(text)
    with pytest.raises(ConfigError, match=said):
        tracker.recorded(file)


def test_the_shipped_configuration_is_tracked_about_its_own_eye() -> None:
    tracking, eye = tracker.tracked_view(load(SHIPPED), None)
    first = next(itertools.islice(tracker.packets(tracking, tracker.sway(eye), rate=100.0, noise_m=0.0), 1))

    assert positions(first, "/head", 0) == [pytest.approx((0.0, 0.0, 1.1))]


@pytest.mark.parametrize(
    ("tracking", "said"),
    [
        ("source: me", "tracking.source.*is not an IP address"),
        ("address: head", "tracking.address.*is not an OSC address"),
        ("axes: [x, y, -y]", "tracking.axes.*names an axis twice"),
        ("port: 0", "tracking.port"),
    ],
)
def test_tracking_that_cannot_be_is_refused(tracking: str, said: str) -> None:
    text = SHIPPED.read_text().replace("{port: 7000, source: 127.0.0.1, address: /head}", f"{{{tracking}}}")
    with pytest.raises(ConfigError, match=said):
        loads(text, name="tracked.yaml")


def test_trackers_of_one_port_have_addresses_of_one_kind() -> None:
    text = SHIPPED.read_text().replace("\nviews:\n  -", "\nviews:\n  - {id: other, tracking: {source: '::1'}}\n  -")
    with pytest.raises(ConfigError, match=r"views\[1\].tracking.source.*another view is tracked"):
        loads(text, name="tracked.yaml")
