"""The result of a conversion: the configuration's values, and a report on every item of the source.

The rule of all converters: each item of a source ends up in `carried` or in `not_carried`, with its line.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from wall.core.errors import ConfigError


class NotThisFormat(ConfigError):  # noqa: N818  (the name says what the file is, not only that it is wrong)
    """The file is not of the format it was read as (exit code 2); the text says name:line:column."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One item of the source: its name there, its line, and what it became or why it was not carried."""

    what: str
    line: int  # of the source, from 1
    why: str = ""


@dataclass(slots=True, kw_only=True)
class Conversion:
    """A configuration as plain values for YAML, and the report on the source that it came from."""

    values: dict[str, Any]
    carried: list[Item]
    not_carried: list[Item]
    panels: int
    ranks: int  # processes that the source names or implies; what a run needs here is for `wall check` to say
    origins: list[Item] = field(default_factory=list)  # what each panel comes from
    assumed: list[str] = field(default_factory=list)  # what the source does not say, one sentence each
    files: dict[str, bytes] = field(default_factory=dict)  # that belong to it, by their paths beside the YAML

    def as_json(self) -> dict[str, Any]:
        """The report: panels, ranks, carried, not_carried, each item with what, line and why."""
        return {
            "panels": self.panels,
            "ranks": self.ranks,
            "carried": [asdict(item) for item in self.carried],
            "not_carried": [asdict(item) for item in self.not_carried],
            "assumed": list(self.assumed),
        }
