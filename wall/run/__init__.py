"""Starts and executes the ranks of a run: bootstrap, clock, links, sinks, the loop.

The package can be called as well: `wall.run(...)` runs a wall in the background, see wall.scripting.background.run. It
is the same name, as Python sets `wall.run` to this package as soon as any of its modules is imported.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Run a wall in the background."""
        background = importlib.import_module("wall.scripting.background")  # above this package, so only when called
        return background.run(*arguments, **options)


sys.modules[__name__].__class__ = _Callable
