"""Updates of the scene: how many edits each takes in, and how many views show it.

All edits that come while something else is done share the next update, and all views share each update (after Ohlenburg
and Broll, "Parallel Multi-View Rendering on Multi-Core Processor Systems"). With a barrier, an update waits until every
view has shown the one before.
"""

from __future__ import annotations

from dataclasses import dataclass

NO_UPDATE = -1
MOST_UPDATES = 4096  # that are remembered: seconds of them, and no view is shown more rarely


@dataclass(slots=True)
class EditsTaken:
    """Counts of the manager: each of its updates takes in the edits that came since the last."""

    updates: int = 0  # in which something moved, or was edited
    edits: int = 0
    together: int = 0  # edits that shared their update with other edits
    _known: int = 0

    def update(self, edits: int, *, changed: bool) -> None:
        """Count an update. `edits`: so many were made since the run began; `changed`: the scene has."""
        came, self._known = edits - self._known, edits
        self.updates += bool(changed or came)
        self.edits += came
        self.together += came if came > 1 else 0


class UpdatesShown:
    """Counts of a renderer that makes images: which updates its views show, and which of them more than one."""

    def __init__(self) -> None:
        self._newest: dict[int, int] = {}  # update that each view shows
        self._views: dict[int, int] = {}  # by update: how many views have shown it
        self.shown = self.shared = 0

    def show(self, view: int, update: int) -> None:
        """A view is refreshed, and shows an update by its number."""
        if update <= self._newest.get(view, NO_UPDATE):
            return
        self._newest[view] = update
        count = self._views[update] = self._views.get(update, 0) + 1
        self.shown += count == 1
        self.shared += count == 2
        if len(self._views) > MOST_UPDATES:
            del self._views[min(self._views)]
