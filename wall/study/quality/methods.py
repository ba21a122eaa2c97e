"""Every arm by its name. A new module of arms is one more table merged here."""

from __future__ import annotations

from collections.abc import Callable

from wall.config.loading import nearest
from wall.core.errors import ConfigError
from wall.study.quality import methods_adaptive as arms_adaptive
from wall.study.quality import methods_afr as arms_afr
from wall.study.quality import methods_plain as arms_plain
from wall.study.quality import methods_progressive as arms_progressive
from wall.study.quality import methods_reduced as arms_reduced
from wall.study.quality import methods_render_cache as arms_render_cache
from wall.study.quality import methods_streams as arms_streams
from wall.study.quality import methods_taa as arms_taa
from wall.study.quality.method import Arm, Setup

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
