"""Every arm by its name."""

from __future__ import annotations

from collections.abc import Callable

from wall.errors import ConfigError
from wall.measure.quality import arms_adaptive, arms_plain
from wall.measure.quality.arm import Arm, Setup

ARMS: dict[str, Callable[[Setup], Arm]] = {**arms_adaptive.ARMS, **arms_plain.ARMS}


def check(names: list[str]) -> None:
    """Raises ConfigError for a name that no arm has."""
    for name in names:
        if name not in ARMS:
            raise ConfigError(f"--arms {name}: no such arm; accepted: {', '.join(ARMS)}")
