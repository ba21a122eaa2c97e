"""What a check finds, and how it is kept within its time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from wall.core.errors import WallError

State = Literal["ok", "warning", "missing"]
LIMIT_S = 10.0  # for a check that starts no program


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """ok: nothing to do; warning: a run is possible; missing: what is wanted will not run."""

    name: str
    state: State
    found: str
    mend: str = ""  # what to do, "" for nothing


@dataclass(frozen=True, slots=True)
class Check:
    """A check, which may raise OSError or WallError: then it has found that something is missing."""

    name: str
    run: Callable[[], Iterable[Finding]]
    limit_s: float = LIMIT_S
    mend: str = ""  # what to do where it fails or does not end


def findings(checks: Iterable[Check]) -> Iterator[Finding]:
    """What each check finds. One that takes too long is left behind."""
    for check in checks:
        found = list[Finding]()
        thread = threading.Thread(target=_run, args=(check, found), name=check.name, daemon=True)
        thread.start()
        thread.join(check.limit_s)
        if thread.is_alive():
            said = f"no answer within {check.limit_s:g} s"
            found = [Finding(name=check.name, state="missing", found=said, mend=check.mend)]
        yield from found


def _run(check: Check, found: list[Finding]) -> None:
    try:
        found.extend(check.run())
    except (OSError, WallError) as error:
        said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        found.append(Finding(name=check.name, state="missing", found=said, mend=check.mend))
