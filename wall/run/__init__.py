"""Starts and executes the ranks of a run: bootstrap, clock, links, sinks, the loop.

The package can be called as well: `wall.run(config, still=False, seconds=None, out=None, record=None, say=None)` runs
a wall in the background, see `help(wall.scripting.background.run)`. It is the same name, as Python sets `wall.run` to
this package as soon as any of its modules is imported.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Run a wall in the background: see wall.scripting.background.run."""
        return _background().run(*arguments, **options)

    @property
    def __signature__(self) -> inspect.Signature:
        """For help() and editors."""
        return inspect.signature(_background().run)


def _background() -> ModuleType:
    """The module that runs walls, which is above this package, so only when it is called."""
    return importlib.import_module("wall.scripting.background")


sys.modules[__name__].__class__ = _Callable
