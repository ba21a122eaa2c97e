"""What came of a conversion: the configuration's values, and an account of everything in the source.

The rule of all converters: each thing in a source ends up in `carried` or in `not_carried`, with its line.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from wall.core.errors import ConfigError


class NotThisFormat(ConfigError):  # noqa: N818  (says what the file is, beside what is wrong)
    """A file that is not of the format it was read as (exit code 2); the text says name:line:column."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One thing of the source: how it calls it, where, and what became of it or why nothing could."""

    what: str
    line: int  # of the source, from 1
    why: str = ""


@dataclass(slots=True, kw_only=True)
class Conversion:
    """A configuration as plain values fit for YAML, and the account of the source that it came from."""

    values: dict[str, Any]
    carried: list[Item]
    not_carried: list[Item]
    panels: int
    ranks: int  # processes that the source names or implies; what a run needs here is for `wall check` to say
    origins: list[Item] = field(default_factory=list)  # what each panel comes from
    assumed: list[str] = field(default_factory=list)  # what the source does not say, one sentence each

    def as_json(self) -> dict[str, Any]:
        """The report: panels, ranks, carried, not_carried, each item with what, line and why."""
        return {
            "panels": self.panels,
            "ranks": self.ranks,
            "carried": [asdict(item) for item in self.carried],
            "not_carried": [asdict(item) for item in self.not_carried],
            "assumed": list(self.assumed),
        }
