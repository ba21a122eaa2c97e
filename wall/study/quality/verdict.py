"""What is said of one bar."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One bar at one spending."""

    what: str
    wanted: str
    came: str
    met: bool
