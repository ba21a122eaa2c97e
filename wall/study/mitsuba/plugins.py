"""What Mitsuba lacks, as dictionaries of plugins that materials.py and lights.py make known to it."""

from __future__ import annotations

from typing import Any

from wall.core.errors import RunError
from wall.study.mitsuba import lights, materials
from wall.study.mitsuba.library import OLDEST_LLVM


def plugin(mi: Any, kind: str, **values: Any) -> dict[str, Any]:
    """A plugin's dictionary. Raises RunError where Mitsuba has no variant that could run it in reasonable time."""
    if not mi.variant().startswith("llvm"):
        raise RunError(
            f"{kind}: Mitsuba's {mi.variant()} has no such thing; wanted its LLVM variant, which needs libLLVM "
            f"{OLDEST_LLVM} or newer (Debian: apt install libllvm19)"
        )
    materials.register(mi)
    lights.register(mi)
    return {"type": kind, **values}
