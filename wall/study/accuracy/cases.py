"""Every hard case, in the order in which they are measured and shown."""

from __future__ import annotations

from wall.core.errors import ConfigError
from wall.study import options
from wall.study.accuracy import (
    accumulation,
    curved,
    inputs,
    light,
    materials,
    messages,
    motion,
    place,
    quantised,
    reprojection,
    rest,
    seams,
    surfaces,
    unbiased,
    watertight,
    wire,
)
from wall.study.accuracy.case import Case

CASES: tuple[Case, ...] = (
    *place.CASES, *watertight.CASES, *light.CASES, *materials.CASES, *surfaces.CASES, *reprojection.CASES,
    *motion.CASES, *accumulation.CASES, *seams.CASES, *curved.CASES, *wire.CASES, *quantised.CASES,
    *inputs.CASES, *messages.CASES, *rest.CASES, *unbiased.CASES,
)  # fmt: skip


def cases_of(text: str) -> tuple[Case, ...]:
    """Cases by name or pattern, such as 'far_*,scale_*'; all of them without any. Raises ConfigError."""
    if not text:
        return CASES
    names = options.picked("--only", text, tuple(case.name for case in CASES))
    return tuple(case for case in CASES if case.name in names)


def case_named(name: str) -> Case:
    """The case of a name. Raises ConfigError where there is none."""
    found = next((case for case in CASES if case.name == name), None)
    if found is None:
        raise ConfigError(f"case {name}: there is no such hard case; wanted one of {', '.join(c.name for c in CASES)}")
    return found
