"""Every method by its name. A new module of methods is one more table merged here."""

from __future__ import annotations

from collections.abc import Callable

from wall.config.loading import nearest
from wall.core.errors import ConfigError
from wall.study.quality import (
    methods_adaptive,
    methods_afr,
    methods_plain,
    methods_progressive,
    methods_reduced,
    methods_render_cache,
    methods_shading_cache,
    methods_streams,
    methods_svgf,
    methods_taa,
    methods_tapestry,
)
from wall.study.quality.method import Method, Setup

FACTORIES: dict[str, Callable[[Setup], Method]] = {
    **methods_adaptive.METHODS,
    **methods_plain.METHODS,
    **methods_progressive.METHODS,
    **methods_reduced.METHODS,
    **methods_taa.METHODS,
    **methods_svgf.METHODS,
    **methods_render_cache.METHODS,
    **methods_afr.METHODS,
    **methods_tapestry.METHODS,
    **methods_shading_cache.METHODS,
    **methods_streams.METHODS,
}
METHODS: tuple[str, ...] = tuple(FACTORIES)


def make_method(name: str, setup: Setup) -> Method:
    """The method of that name, its free image traced. Raises ConfigError for a name that is not in METHODS."""
    check_method(name)
    return FACTORIES[name](setup)


def check_method(name: str) -> None:
    """Raises ConfigError for a name that no method has."""
    if name not in FACTORIES:
        raise ConfigError(f"--methods {name}: no such method{nearest(name, METHODS)}; accepted: {', '.join(METHODS)}")
