"""What the words of `wall measure quality` stand for."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from wall.core.errors import ConfigError
from wall.core.kernel_cache import PACKAGE
from wall.study import options
from wall.study.options import cores_of as cores_of
from wall.study.quality.methods import METHODS
from wall.study.quality.methods_streams import absent
from wall.study.quality.methods_tapestry import METHODS as TAKE_HOURS
from wall.study.quality.requirements import BESIDE_SCENES, SCENES
from wall.study.quality.sweep import NO_RATE_OF_ITS_OWN, RATES

SCENES_FOLDER = PACKAGE.parent / "configs" / "measure"
FASTEST_RATE = 1e9
NEEDED = {"flip_evaluator": "flip-evaluator", "skimage": "scikit-image", "matplotlib": "matplotlib"}


def check_installed() -> None:
    """Raises RunError, before anything is measured, where the extra `measure` is not installed."""
    options.check_installed("wall measure quality", NEEDED)


def configs_of(configs: Iterable[Path], scenes: str) -> tuple[Path, ...]:
    """The configurations given, or the project's own; `scenes` picks some of them by name. Raises ConfigError."""
    found = tuple(configs) or tuple(_own(name) for name in SCENES)
    beside = () if configs else tuple(_own(name) for name in BESIDE_SCENES)
    known = {config.stem: config for config in (*found, *beside)}
    options.check_files(found)
    return tuple(known[name] for name in options.picked("--scenes", scenes, tuple(known))) if scenes else found


def _own(name: str) -> Path:
    return SCENES_FOLDER / f"{name}.yaml"


def methods_of(text: str, *, clock: str) -> tuple[str, ...]:
    """Methods by name or pattern; without any, all but the ablations and Tapestry, as far as the clock knows them.

    Patterns leave out what cannot run here. Raises ConfigError for a name that is unknown, or is of such a method.
    """
    here = tuple(method for method in METHODS if method not in absent())
    if text:
        if named := next((word for word in map(str.strip, text.split(",")) if word in absent()), None):
            raise ConfigError(f"--methods {named}: {absent()[named]}")
        return options.picked("--methods", text, here)
    usual = (name for name in here if ":" not in name and name not in TAKE_HOURS)
    return tuple(name for name in usual if not (clock == "cpu" and name in NO_RATE_OF_ITS_OWN))


def rates_of(text: str) -> tuple[float, ...]:
    """Rays a second, such as 100000,4e5,800k."""
    wanted = f"rays a second, more than 0 and at most {FASTEST_RATE:g}"
    return options.each("--rates", text, _rate, wanted) if text else RATES


def _rate(word: str) -> float:
    factor = {"k": 1e3, "m": 1e6}.get(word[-1:].lower(), 1.0)
    rate = float(word[:-1] if factor > 1.0 else word) * factor
    if not 0.0 < rate <= FASTEST_RATE:
        raise ValueError(word)
    return rate
