"""Why a wall is slower than wanted, in words: which rank, tracing or making images, and what to lower."""

from __future__ import annotations

from collections.abc import Mapping

from wall.packets.control import Heartbeat
from wall.roles.plan import HEAD, Layout

LEAST_PACE = 0.8  # of the refreshes that a view wants; less is slow
PROMPT_S = 0.3  # an image that is right so soon after an input looks as if it followed the hand
SETTLED_S = 3.0  # a rank's rates say little before


def why_slow(layout: Layout, beats: Mapping[int, Heartbeat]) -> str:
    """The slowest rank and its remedy; "" if all keep up, or too little is known yet.

    Making images comes first: tracing more samples helps nobody who sees three images a second.
    """
    known = {rank: beat for rank, beat in beats.items() if beat.seconds >= SETTLED_S}
    if known and all(beat.complete for beat in known.values()):
        return ""  # images that have all their samples are not made again
    paces = {rank: pace for rank, beat in known.items() if (pace := _pace(layout, rank, beat)) is not None}
    if paces and paces[slowest := min(paces, key=lambda rank: paces[rank])] < LEAST_PACE:
        made, wanted = known[slowest].refreshes_per_s, _wanted(layout, slowest)
        return (
            f"{_name(layout, slowest)} makes {made:.3g} of {wanted:.3g} images a second{_of_views(layout, slowest)}. "
            f"Lower: pixels, refresh_hz{_or_spread(layout, slowest)}."
        )
    late = {rank: beat.right_s for rank, beat in known.items() if beat.right_s > PROMPT_S and _works(layout, beat)}
    if not late:
        return ""
    # samples that travel are judged where they are shown: of all renderers the one with the fewest a pixel is slow
    slowest = max(late, key=lambda rank: late[rank])
    right_s = late[slowest]
    if layout.role(slowest) != "renderer":
        rates = {
            rank: known[rank].samples_per_s / _pixels(layout, rank) for rank in layout.renderers() if rank in known
        }
        rates = {rank: rate for rank, rate in rates.items() if rate > 0.0}  # one at rest is not slow
        slowest = min(rates, key=lambda rank: rates[rank], default=slowest)
    if layout.role(slowest) != "renderer":
        return ""
    rate = known[slowest].samples_per_s / _pixels(layout, slowest)
    return (
        f"{_name(layout, slowest)} traces {rate:.2g} samples a pixel and second; its image is right after "
        f"{right_s:.2g} s. Lower: pixels a rank (more ranks, ranks_per_panel), lights, surfaces of paths."
    )


def _works(layout: Layout, beat: Heartbeat) -> bool:
    """Not a renderer at rest: it has ended what it was late with."""
    return layout.role(beat.rank) != "renderer" or beat.samples_per_s > 0.0


def _name(layout: Layout, rank: int) -> str:
    if layout.role(rank) != "renderer":
        return f"Rank {rank} ({layout.role(rank)})"
    regions = layout.regions_of(rank)
    return f"Rank {rank} ({layout.panel(regions[0]).id})" if regions else f"Rank {rank}"


def _of_views(layout: Layout, rank: int) -> str:
    count = len(_views(layout, rank))
    return f" of {count} views" if count > 1 else ""


def _views(layout: Layout, rank: int) -> tuple[int, ...]:
    """The views whose images a rank refreshes."""
    if layout.role(rank) == "renderer":
        return tuple(sorted({r.view for r in layout.regions_of(rank) if layout.layer(r).at_renderer}))
    return tuple(range(len(layout.config.views)))


def _wanted(layout: Layout, rank: int) -> float:
    return sum(layout.config.views[view].refresh_hz for view in _views(layout, rank))


def _pace(layout: Layout, rank: int, beat: Heartbeat) -> float | None:
    """Refreshes made, of those wanted; None for a rank that makes no image."""
    wanted = _wanted(layout, rank)
    return beat.refreshes_per_s / wanted if wanted > 0.0 else None


def _pixels(layout: Layout, rank: int) -> int:
    return max(1, layout.area_of(rank))  # with balance a strip may be empty


def _or_spread(layout: Layout, rank: int) -> str:
    if rank == HEAD and layout.graph.compositors == 1 and any(not layer.at_renderer for layer in layout.graph.layers):
        return ", or share its work: graph: {compositors: 2}"
    return ", or give each rank a core of its own"
