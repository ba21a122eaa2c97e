"""What viewers of the page may show instead: configurations and models of the run's folder, and built-in scenes."""

from __future__ import annotations

import threading
import time
import weakref
from contextlib import suppress
from pathlib import Path
from weakref import WeakKeyDictionary

from wall.config.loading import Loaded, load, with_scene
from wall.core.errors import ConfigError, EditError
from wall.display.base import Offers
from wall.roles.config_edits import text_of
from wall.roles.plan import Layout, make_layout
from wall.roles.reloading import as_run, check_fits
from wall.scene.loader_process import MODEL_SUFFIXES
from wall.scene.sources import BUILT_IN

CONFIGURATIONS = (".yaml", ".yml")
MOST_FILES = 64  # of either kind: looking into so many configurations takes half a second
MOST_BYTES = 1 << 18  # of a configuration
LOOK_S = 2.0  # between looks whether a folder has changed
AS_BEGUN = "as at the start"  # the name of what no file is like


class Choices:
    """Names of what may be shown instead of a layout's configuration; no other file can be named."""

    def __init__(self, layout: Layout, first: Layout | None = None) -> None:
        """Looks into the folder: of its configurations those are offered that can replace this one as it runs.

        `first`: what the run began with, which is offered too where no file is like it; None: `layout`.
        """
        self._layout, self._first = layout, (first or layout).loaded
        folder = layout.loaded.folder
        self._configurations = [path.name for path in _files(folder, CONFIGURATIONS) if self._fits(path)]
        self._models = [path.name for path in _files(folder, MODEL_SUFFIXES)]
        own = () if self._is_file(self._first) else (AS_BEGUN,)
        self.names = (*own, *self._configurations, *self._models, *BUILT_IN)
        self.shown = self._shown()

    def load(self, name: str) -> tuple[str, str]:
        """The text of a configuration, and the path of its file. Raises EditError."""
        loaded = self._layout.loaded
        try:
            if name == AS_BEGUN and name in self.names:
                return text_of(self._first.config), str(self._first.path)
            if name in self._configurations:
                path = loaded.folder / name
                return path.read_text(encoding="utf-8"), str(path)
            if name in (*self._models, *BUILT_IN):
                other = with_scene(loaded, str(loaded.folder / name) if name in self._models else name)
                return text_of(other.config), str(loaded.path)
        except (OSError, ValueError, ConfigError) as error:
            raise EditError(f"{name}: {error}") from error
        raise EditError(f"{name[:60]!r}: is no choice; accepted: {', '.join(self.names)}")

    def _fits(self, path: Path) -> bool:
        with suppress(OSError, ConfigError):
            if path.is_file() and path.stat().st_size <= MOST_BYTES:
                check_fits(self._layout, make_layout(as_run(self._layout, load(path))))
                return True
        return False

    def _shown(self) -> str:
        """Which one runs: a configuration as its file says, or what it shows in place of that."""
        loaded = self._layout.loaded
        if self._is_file(loaded):
            return loaded.path.name
        if AS_BEGUN in self.names and loaded.config == self._first.config:
            return AS_BEGUN
        source = loaded.config.scene.source
        name = Path(source).name if isinstance(source, str) else ""
        return name if name in (*self._models, *BUILT_IN) else ""

    def _is_file(self, loaded: Loaded) -> bool:
        """Whether a configuration is what its file says, and that file is offered."""
        with suppress(OSError, ConfigError):
            offered = loaded.path.name in self._configurations and loaded.folder == self._layout.loaded.folder
            return offered and load(loaded.path).config == loaded.config
        return False


def _files(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    with suppress(OSError):
        return sorted(path for path in folder.iterdir() if path.suffix.lower() in suffixes)[:MOST_FILES]
    return []


_newest = WeakKeyDictionary[Offers, Layout]()  # by sink: the layout whose choices it is to offer
_first = WeakKeyDictionary[Offers, Layout]()  # by sink: what the run began with
_offering = threading.Lock()


def offer(sink: Offers, layout: Layout) -> None:
    """Offer viewers the choices of a layout, as soon as they are found, unless it is to offer none; later again when
    files of its folder have come, gone, or changed.

    Those found of a layout whose place another one has taken meanwhile are dropped.
    """
    with _offering:
        _newest[sink], first = layout, _first.setdefault(sink, layout)
    if layout.config.output.browser.choices:
        looking = (weakref.ref(sink), layout, first)  # the sink ends when the run does
        threading.Thread(target=_look, args=looking, daemon=True, name="choices").start()


def _look(to: weakref.ref[Offers], layout: Layout, first: Layout) -> None:
    found: set[tuple[str, int, int]] | None = None
    while True:
        there = _there(layout.loaded.folder)
        choices = Choices(layout, first) if there != found else None
        with _offering:
            sink = to()
            if sink is None or _newest[sink] is not layout:
                return
            if choices is not None:
                sink.offer(choices)
            del sink
        found = there
        time.sleep(LOOK_S)


def _there(folder: Path) -> set[tuple[str, int, int]]:
    """What tells whether files that may be offered have come to a folder, gone, or changed."""
    found = set()
    for path in (*_files(folder, CONFIGURATIONS), *_files(folder, MODEL_SUFFIXES)):
        with suppress(OSError):
            state = path.stat()
            found.add((path.name, state.st_mtime_ns, state.st_size))
    return found
