"""wall: a parallel, sort-first, frameless ray-traced renderer for tiled display walls.

From Python: `wall.Scene`, `wall.render` and `wall.run` (docs/guide/python.md). What they need is imported when they are
first used, so that `import wall` stays cheap.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wall import client as client
    from wall.scripting.background import Running as Running
    from wall.scripting.background import run as run
    from wall.scripting.rendering import render as render
    from wall.scripting.scene import Scene as Scene

__all__ = ["Running", "Scene", "client", "render", "run"]

_FOUND_IN = {
    "Running": "wall.scripting.background",
    "client": "wall.client",
    "Scene": "wall.scripting.scene",
    "render": "wall.scripting.rendering",
    "run": "wall.run",  # the package of that name, which can be called
}


def __getattr__(name: str) -> Any:
    if name not in _FOUND_IN:
        raise AttributeError(f"module 'wall' has no attribute {name!r}")
    module = importlib.import_module(_FOUND_IN[name])
    return module if name in ("client", "run") else getattr(module, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
