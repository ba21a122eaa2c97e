"""The configurations that come with the program: what there are, and a copy of them to change."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from wall.commands.inputs import EXAMPLES
from wall.core.errors import RunError

SENTENCE = re.compile(r".*?(?<!et al)\.(?= [A-Z`]|$)")


def examples() -> Iterator[tuple[str, str]]:
    """Each configuration's path in its folder, and the first sentence of what it says of itself."""
    for path in sorted(EXAMPLES.rglob("*.yaml"), key=lambda path: (len(path.parts), path)):
        lines = path.read_text(encoding="utf-8").split("\n")
        comment = " ".join(line.removeprefix("#").strip() for line in lines[1:] if line.startswith("#")).strip()
        first = SENTENCE.match(comment)
        yield str(path.relative_to(EXAMPLES)), first[0] if first else comment


def copy_examples(folder: Path) -> int:
    """Copy all of them, with the files that they name, into a folder. Returns how many files that are.

    Raises RunError where one of them is there already, before anything is written, or where none can be written.
    """
    files = [path for path in sorted(EXAMPLES.rglob("*")) if path.is_file()]
    for path in files:
        if (there := folder / path.relative_to(EXAMPLES)).exists():
            raise RunError(f"{there}: is there already; wanted a folder without it")
    try:
        for path in files:
            copy = folder / path.relative_to(EXAMPLES)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
    except OSError as error:
        raise RunError(f"{folder}: cannot be written ({error.strerror or error})") from None
    return len(files)
