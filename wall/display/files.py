"""Write files so that a reader sees the old file or the whole new one, never a part."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wall.core.errors import ConfigError, RunError


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and move it there at the end of the block.

    Raises RunError naming the file and the reason when it cannot be written.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def check_target(path: Path, suffixes: tuple[str, ...], *, option: str = "-o") -> None:
    """Refuse a file that cannot be written, before anything is rendered for it. Raises ConfigError."""
    if path.suffix.lower() not in suffixes:
        raise ConfigError(f"{option} {path}: cannot write '{path.suffix}'; accepted: {', '.join(suffixes)}")
    if not path.absolute().parent.is_dir():
        raise ConfigError(f"{option} {path}: there is no folder {path.parent}")
