"""How words of `wall measure` commands are read, and what must be there before anything is measured."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

from wall.config.loading import nearest
from wall.core.errors import ConfigError, RunError

MOST_CORES = 1024.0
MOST_COUNT = 1 << 20
T = TypeVar("T")


def check_installed(command: str, needed: Mapping[str, str]) -> None:
    """Raises RunError where packages are not installed; `needed`: their names by module."""
    missing = [name for module, name in needed.items() if find_spec(module) is None]
    if missing:
        raise RunError(f"{command} needs {', '.join(missing)}: pip install -e '.[measure]' in the clone")


def check_files(configs: Iterable[Path]) -> None:
    """Raises ConfigError where a configuration is not a file."""
    for config in configs:
        if not config.is_file():
            raise ConfigError(
                f"{config}: no such file; accepted: YAML configurations, such as configs/measure/orbit.yaml"
            )


def check_names(configs: Iterable[Path]) -> None:
    """Raises ConfigError where two configurations have one name."""
    names = [config.stem for config in configs]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ConfigError(f"two configurations are called {twice}: rows are told apart by it; rename one of the files")


def picked(option: str, text: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """The names that words match, by name or pattern, in the order of the words. Raises ConfigError."""
    found: dict[str, None] = {}
    for word in (part.strip() for part in text.split(",")):
        matching = [name for name in known if fnmatchcase(name, word)]
        if not matching:
            raise ConfigError(f"{option} {word}: unknown{nearest(word, known)}; accepted: {', '.join(known)}")
        found.update(dict.fromkeys(matching))
    return tuple(found)


def each(option: str, text: str, parse: Callable[[str], T], wanted: str) -> tuple[T, ...]:
    """What each word stands for, once; `parse` raises ValueError for what is not wanted. Raises ConfigError."""
    found = []
    for word in (part.strip() for part in text.split(",")):
        try:
            found.append(parse(word))
        except ValueError:
            raise ConfigError(f"{option} {word}: wanted {wanted}") from None
    return tuple(dict.fromkeys(found))


def cores_of(text: str) -> tuple[float, ...]:
    """CPU seconds a second, such as 0.5,1,2. Raises ConfigError."""
    return each("--cores", text, _cores, f"CPU seconds a second, more than 0 and at most {MOST_CORES:g}")


def _cores(word: str) -> float:
    cores = float(word)
    if not 0.0 < cores <= MOST_CORES:
        raise ValueError(word)
    return cores


def counts_of(option: str, text: str) -> tuple[int, ...]:
    """Whole numbers such as 1,4,16, from small to large. Raises ConfigError."""
    return tuple(sorted(numbers_of(option, text, most=MOST_COUNT, wanted="whole numbers")))


def numbers_of(option: str, text: str, *, most: int, wanted: str, otherwise: str = "") -> tuple[int, ...]:
    """Whole numbers from 1 to `most`, each once; `wanted`: what they are, in errors. Raises ConfigError."""

    def parse(word: str) -> int:
        number = int(word)
        if not 1 <= number <= most:
            raise ValueError(word)
        return number

    return each(option, text, parse, f"{wanted} from 1 to {most}{otherwise}")
