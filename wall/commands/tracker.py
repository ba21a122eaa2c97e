"""A simulated tracker: sends a scripted or recorded movement of the head, as a tracker of the configuration would."""

from __future__ import annotations

import csv
import math
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from wall.config.loading import Loaded
from wall.config.tracking import FARTHEST_M, TrackingConfig
from wall.core.data import Float64
from wall.core.errors import ConfigError, RunError
from wall.geometry.eyes import standing_eye
from wall.geometry.tracking import tracker_from_wall
from wall.packets.osc import message_of
from wall.roles.plan import make_layout

SWAY = "sway"
SWAY_M, SWAY_S = (0.25, 0.06, 0.15), (4.0, 2.7, 6.5)  # how far and how fast along the wall's x, y and z

Movement = Callable[[float], Float64]  # seconds to (3,) metres, wall frame


def tracked_view(loaded: Loaded, name: str | None) -> tuple[TrackingConfig, Float64]:
    """The tracking of a view, or of the first that has one, and the view's own eye (3,), metres, wall frame.

    Raises ConfigError where there is none.
    """
    views = loaded.config.views
    tracked = [k for k, view in enumerate(views) if view.tracking is not None and name in (None, view.id)]
    if not tracked:
        raise loaded.error(
            ("views",), f"no view {name or ''} has tracking".replace("  ", " "), "tracking: {} in a view"
        )
    config = views[tracked[0]].tracking
    assert config is not None
    return config, standing_eye(loaded, make_layout(loaded).wall.of_view(tracked[0]), tracked[0])


def sway(eye: Float64) -> Movement:
    """A viewer who sways about an eye (3,), metres, wall frame; at most 0.45 m/s and 0.72 m/s^2."""

    def at(seconds: float) -> Float64:
        found: Float64 = eye + np.array(SWAY_M) * np.sin(2 * math.pi * seconds / np.array(SWAY_S))
        return found

    return at


def recorded(path: Path) -> Movement:
    """A movement from a file: a line `time,x,y,z` each, seconds and metres in the wall's frame; it starts over.

    Raises ConfigError for anything else.
    """
    rows: list[list[float]] = []
    try:
        with path.open(newline="", encoding="utf-8") as file:
            for number, row in enumerate(csv.reader(file), 1):
                if number == 1 and row[:1] == ["time"]:
                    continue
                values = [float(value) for value in row]
                if len(values) != 4 or not all(map(math.isfinite, values)) or max(map(abs, values[1:])) > FARTHEST_M:
                    raise ValueError(f"{row}: want time, x, y, z")
                if values[0] < 0.0 or (rows and values[0] <= rows[-1][0]):
                    raise ValueError(f"time {values[0]:g}: want times from 0 on that grow")
                rows.append(values)
    except (OSError, ValueError, csv.Error) as error:
        where = f"{path}:{number}" if isinstance(error, ValueError) and path.is_file() else str(path)
        raise ConfigError(f"{where}: {getattr(error, 'strerror', None) or error}") from None
    if len(rows) < 2:
        raise ConfigError(f"{path}: {len(rows)} positions; want two at least, a line time,x,y,z each")
    table = np.array(rows)

    def at(seconds: float) -> Float64:
        moment = table[0, 0] + seconds % (table[-1, 0] - table[0, 0])
        return np.array([np.interp(moment, table[:, 0], table[:, axis]) for axis in (1, 2, 3)])

    return at


def packets(config: TrackingConfig, movement: Movement, *, rate: float, noise_m: float) -> Iterator[bytes]:
    """What a tracker sends, packet by packet, at `rate` a second; `noise_m`: standard deviation of each coordinate."""
    random, count = np.random.default_rng(1), 0
    while True:
        position = movement(count / rate) + noise_m * random.standard_normal(3)
        yield message_of(config.address, tracker_from_wall(config, position), config.first)
        count += 1


def send(packets: Iterator[bytes], to: tuple[str, int], *, rate: float, seconds: float | None) -> int:
    """Send packets by UDP until time is up, or for ever. Returns how many. Raises RunError where that fails."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(*to, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family, kind) as out:
            began, count = time.monotonic(), 0
            while seconds is None or count < seconds * rate:
                out.sendto(next(packets), address)
                count += 1
                time.sleep(max(0.0, began + count / rate - time.monotonic()))
            return count
    except OSError as error:
        raise RunError(f"cannot send to {to[0]}:{to[1]}: {error.strerror or error}") from error
