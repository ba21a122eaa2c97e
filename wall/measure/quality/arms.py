"""Every arm by its name. A new module of arms is one more table merged here."""

from __future__ import annotations

from collections.abc import Callable

from wall.config.loading import nearest
from wall.errors import ConfigError
from wall.measure.quality import (
    arms_adaptive,
    arms_afr,
    arms_plain,
    arms_progressive,
    arms_reduced,
    arms_render_cache,
    arms_streams,
    arms_taa,
)
from wall.measure.quality.arm import Arm, Setup

FACTORIES: dict[str, Callable[[Setup], Arm]] = {
    **arms_adaptive.ARMS,
    **arms_plain.ARMS,
    **arms_progressive.ARMS,
    **arms_reduced.ARMS,
    **arms_taa.ARMS,
    **arms_render_cache.ARMS,
    **arms_afr.ARMS,
    **arms_streams.ARMS,
}
ARMS: tuple[str, ...] = tuple(FACTORIES)


def make_arm(name: str, setup: Setup) -> Arm:
    """The arm of that name, its free picture traced. Raises ConfigError for a name that is not in ARMS."""
    check_arm(name)
    return FACTORIES[name](setup)


def check_arm(name: str) -> None:
    """Raises ConfigError for a name that no arm has."""
    if name not in FACTORIES:
        raise ConfigError(f"--arms {name}: no such arm{nearest(name, ARMS)}; accepted: {', '.join(ARMS)}")
