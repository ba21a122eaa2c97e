"""A page that other pages of this machine may show in a frame, for walls that a script or a notebook runs."""

from __future__ import annotations

from typing import Any

from wall.config.graph import PresetGraph
from wall.config.loading import Loaded


def with_page(loaded: Loaded, *, sink: bool = True) -> Loaded:
    """The same wall with a page that may be shown in a frame; graphs of nodes have one if they say so.

    `sink`: a preset graph without a page gets one.
    """
    config = loaded.config
    browser = config.output.browser.model_copy(update={"embed": True})
    changes: dict[str, Any] = {"output": config.output.model_copy(update={"browser": browser})}
    if sink and isinstance(config.graph, PresetGraph) and "browser" not in config.graph.sinks:
        changes["graph"] = config.graph.model_copy(update={"sinks": (*config.graph.sinks, "browser")})
    return loaded.with_config(config.model_copy(update=changes))
