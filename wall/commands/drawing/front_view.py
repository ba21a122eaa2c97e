"""The front view of a wall with every screen in its true size: a flat wall as it is, others unrolled.

Screens of one plane form a *facet*. Facets are unfolded about the edges at which they meet, like a paper model,
beginning with the one straight ahead of the eye. Facets that meet no other, or would overlap when unfolded, are laid
beside the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.commands.drawing.model import Screen
from wall.core.data import Float64

FLAT_COSINE = 0.99996  # half a degree: real files round their corners
FLAT_OFFSET = 0.01  # of the screen's smaller edge
NEIGHBOUR_GAP = 0.5  # of the shorter edge: wider gaps are no hinge
COVERED = 0.01  # share of the smaller screen that may overlap another facet's
PARALLEL_COSINE = 0.999  # between edges that may meet
SAME_DISTANCE = 1.01  # ratio of distances that count as equal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placed:
    """A screen on the drawing's plane: metres, x right, y up."""

    screen: Screen
    lower_left: Float64  # (2,)
    right: Float64  # (2,) unit
    up: Float64  # (2,) unit
    size: tuple[float, float]  # of the lit area

    def rect(self, left: float = 0.0, right: float = 0.0, top: float = 0.0, bottom: float = 0.0) -> Float64:
        """(4, 2) corners of the lit area, wider by so many metres a side; from the lower left, anticlockwise."""
        x0, x1, y0, y1 = -left, self.size[0] + right, -bottom, self.size[1] + top
        return np.array(
            [self.lower_left + x * self.right + y * self.up for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
        )

    def moved(self, turn: Float64, shift: Float64) -> Placed:
        """The screen turned by a (2, 2) rotation, then shifted."""
        return Placed(
            screen=self.screen,
            lower_left=turn @ self.lower_left + shift,
            right=turn @ self.right,
            up=turn @ self.up,
            size=self.size,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrontView:
    """All screens in one plane, and how they were laid there."""

    kind: str  # "flat", "unrolled" or "apart"
    placed: tuple[Placed, ...]

    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top of all screens with their bezels, metres."""
        corners = np.concatenate([placed.rect(*placed.screen.bezel) for placed in self.placed])
        (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
        return float(left), float(bottom), float(right), float(top)


def front_view(screens: Sequence[Screen]) -> FrontView:
    """Lay screens in one plane."""
    facets = _facets(screens)
    laid = [_in_plane([screens[i] for i in facet]) for facet in facets]

    if len(facets) == 1:
        kind, groups = "flat", [laid[0]]
    else:
        kind, groups = _unfolded(screens, facets, laid)
    flat = {id(placed.screen): placed for group in _in_a_row(groups) for placed in group}
    return FrontView(kind=kind, placed=tuple(flat[id(screen)] for screen in screens))


def axes_of(screen: Screen) -> tuple[Float64, Float64, Float64]:
    """Unit vectors right, up, and towards the viewer; (3,) each, wall frame."""
    right, up = screen.corners[1] - screen.corners[0], screen.corners[2] - screen.corners[0]
    right = right / np.linalg.norm(right)
    normal = np.cross(right, up)
    normal = normal / np.linalg.norm(normal)
    return right, np.cross(normal, right), normal


def size_of(screen: Screen) -> tuple[float, float]:
    """Width and height of the lit area, metres."""
    right, up = screen.corners[1] - screen.corners[0], screen.corners[2] - screen.corners[0]
    return float(np.linalg.norm(right)), float(np.linalg.norm(up))


def _facets(screens: Sequence[Screen]) -> list[list[int]]:
    """Indices of screens that lie in one plane and face the same way; the facet straightest ahead comes first."""
    found: list[tuple[Float64, Float64, float, list[int]]] = []
    for i, screen in enumerate(screens):
        _, _, normal = axes_of(screen)
        middle, small = screen.corners.mean(axis=0), min(size_of(screen))
        for other, point, least, members in found:
            if normal @ other > FLAT_COSINE and abs((middle - point) @ other) < FLAT_OFFSET * min(small, least):
                members.append(i)
                break
        else:
            found.append((normal, middle, small, [i]))
    return [members for *_, members in sorted(found, key=lambda facet: -facet[0][2])]


def _in_plane(screens: Sequence[Screen]) -> list[Placed]:
    """Screens of one plane in its coordinates, with up as near to the wall frame's +y as possible."""
    right, up, normal = axes_of(screens[0])
    if abs(normal[1]) < 0.9:
        right = np.cross([0.0, 1.0, 0.0], normal)
        right = right / np.linalg.norm(right)
        up = np.cross(normal, right)
    basis = np.stack([right, up])
    placed = []
    for screen in screens:
        own_right, own_up, _ = axes_of(screen)
        placed.append(
            Placed(
                screen=screen,
                lower_left=basis @ screen.corners[0],
                right=_unit(basis @ own_right),
                up=_unit(basis @ own_up),
                size=size_of(screen),
            )
        )
    return placed


def _unfolded(
    screens: Sequence[Screen], facets: list[list[int]], laid: list[list[Placed]]
) -> tuple[str, list[list[Placed]]]:
    """Unfold facets that meet together; each alone where they would overlap."""
    edges = [np.concatenate([_edges(screens[i]) for i in facet]) for facet in facets]
    gaps = _facet_gaps(edges)
    left = list(range(len(facets)))
    groups: list[list[Placed]] = []
    while left:
        group = {left[0]: laid[left[0]]}
        while hinge := _nearest(gaps, list(group), [k for k in left if k not in group]):
            inside, outside = hinge
            gap = _gaps(edges[inside], edges[outside])
            a, b = (int(k) for k in np.unravel_index(int(np.argmin(gap)), gap.shape))
            here, there = _edge_on(group[inside], a), _edge_on(laid[outside], b)
            group[outside] = _folded(here, there, (edges[inside][a], edges[outside][b]), laid[outside])
        left = [k for k in left if k not in group]
        whole = [placed for member in group.values() for placed in member]
        owner = [k for k, member in group.items() for _ in member]
        groups.extend([laid[k] for k in group] if _covers_itself(whole, owner) else [whole])
    return ("unrolled" if len(groups) == 1 else "apart"), groups


def _edges(screen: Screen) -> Float64:
    """(4, 2, 3) start and end of each edge: bottom, right, top, left, anticlockwise."""
    lower_left, lower_right, upper_left = screen.corners
    around = [lower_left, lower_right, lower_right + upper_left - lower_left, upper_left]
    return np.array([[around[k], around[(k + 1) % 4]] for k in range(4)])


def _edge_on(placed: list[Placed], edge: int) -> Float64:
    """(2, 2) start and end of the edge of that number on the drawing's plane."""
    corners = placed[edge // 4].rect()
    return corners[[edge % 4, (edge + 1) % 4]]


def _facet_gaps(edges: list[Float64]) -> Float64:
    """(n, n) distances in metres between facets whose edges could be a hinge, inf for others."""
    low = np.array([own.min(axis=(0, 1)) for own in edges])
    high = np.array([own.max(axis=(0, 1)) for own in edges])
    reach = np.array([NEIGHBOUR_GAP * np.linalg.norm(own[:, 1] - own[:, 0], axis=1).max() for own in edges])
    found = np.full((len(edges), len(edges)), np.inf)
    for i in range(len(edges)):
        near = ((low[i] - reach[i] <= high[i + 1 :]) & (low[i + 1 :] <= high[i] + reach[i])).all(axis=1)
        for j in i + 1 + np.flatnonzero(near):
            found[i, j] = found[j, i] = _gaps(edges[i], edges[j]).min()
    return found


def _nearest(gaps: Float64, inside: list[int], outside: list[int]) -> tuple[int, int] | None:
    """The two nearest facets, one laid already and one not; None where no two meet.

    Of nearly equal distances the facet that was laid first wins, so that both sides unroll from the middle.
    """
    if not outside:
        return None
    between = gaps[np.ix_(inside, outside)]
    least = float(between.min())
    if not np.isfinite(least):
        return None
    near = np.argwhere(between <= least * SAME_DISTANCE + 1e-6)[0]
    return inside[int(near[0])], outside[int(near[1])]


def _gaps(a: Float64, b: Float64) -> Float64:
    """(n, m) distances in metres between edges, inf where they are not parallel or too far apart to meet."""
    along_a, along_b = a[:, 1] - a[:, 0], b[:, 1] - b[:, 0]
    long_a, long_b = np.linalg.norm(along_a, axis=1), np.linalg.norm(along_b, axis=1)
    cosine = (along_a @ along_b.T) / np.outer(long_a, long_b)
    middle = b.mean(axis=1)[None, :] - a[:, None, 0]  # (n, m, 3)
    along = np.clip(np.einsum("nmk,nk->nm", middle, along_a / long_a[:, None] ** 2), 0, 1)
    one_way = np.linalg.norm(middle - along[..., None] * along_a[:, None], axis=2)
    middle = a.mean(axis=1)[:, None] - b[None, :, 0]
    along = np.clip(np.einsum("nmk,mk->nm", middle, along_b / long_b[:, None] ** 2), 0, 1)
    gap = np.minimum(one_way, np.linalg.norm(middle - along[..., None] * along_b[None], axis=2))
    apart = (cosine > -PARALLEL_COSINE) | (gap > NEIGHBOUR_GAP * np.minimum(long_a[:, None], long_b[None, :]))
    found: Float64 = np.where(apart, np.inf, gap)
    return found


def _folded(here: Float64, there: Float64, in_space: tuple[Float64, Float64], facet: list[Placed]) -> list[Placed]:
    """A facet turned about its edge `there` until it lies beyond the edge `here`, as far away as in space."""
    along, back = _unit(here[1] - here[0]), _unit(there[0] - there[1])
    outward = np.array([along[1], -along[0]])  # edges run anticlockwise, so outside is at their right
    cosine, sine = back @ along, back[0] * along[1] - back[1] * along[0]
    rotation = np.array([[cosine, -sine], [sine, cosine]])
    here_3d, there_3d = in_space
    offset = there_3d.mean(axis=0) - here_3d.mean(axis=0)
    slide = float(offset @ _unit(here_3d[1] - here_3d[0]))
    gap = float(np.sqrt(max(offset @ offset - slide * slide, 0.0)))
    target = here.mean(axis=0) + slide * along + gap * outward
    shift = target - rotation @ there.mean(axis=0)
    return [placed.moved(rotation, shift) for placed in facet]


def _covers_itself(placed: list[Placed], facet_of: list[int]) -> bool:
    """Whether screens of different facets overlap by more than COVERED."""
    rects = np.array([one.rect() for one in placed])
    for i, j in meeting(rects):
        shared = meet(rects[i], rects[j]) if facet_of[i] != facet_of[j] else None
        if shared is not None and area(shared) > COVERED * min(area(rects[i]), area(rects[j])):
            return True
    return False


def _in_a_row(groups: list[list[Placed]]) -> list[list[Placed]]:
    """Groups side by side from the left, with their middles at one height; a single group stays as it is."""
    if len(groups) == 1:
        return groups
    boxes = [np.concatenate([placed.rect() for placed in group]) for group in groups]
    widths = [float(np.ptp(box[:, 0])) for box in boxes]
    gap, x, row = 0.25 * float(np.mean(widths)), 0.0, []
    for group, box, width in zip(groups, boxes, widths, strict=True):
        shift = np.array([x - box[:, 0].min(), -(box[:, 1].min() + box[:, 1].max()) / 2])
        row.append([placed.moved(np.eye(2), shift) for placed in group])
        x += width + gap
    return row


def meeting(polygons: Float64) -> list[tuple[int, int]]:
    """Pairs i < j of (n, k, 2) polygons whose bounding rectangles overlap."""
    low, high = polygons.min(axis=1), polygons.max(axis=1)
    found: list[tuple[int, int]] = []
    for i in range(len(polygons) - 1):
        near = ((low[i] < high[i + 1 :]) & (low[i + 1 :] < high[i])).all(axis=1)
        found.extend((i, i + 1 + int(j)) for j in np.flatnonzero(near))
    return found


def meet(a: Float64, b: Float64) -> Float64 | None:
    """The intersection of two convex polygons (n, 2), both anticlockwise; None where it has no area.

    Sutherland and Hodgman, 1974.
    """
    if (a.max(axis=0) <= b.min(axis=0)).any() or (b.max(axis=0) <= a.min(axis=0)).any():
        return None
    kept = [tuple(point) for point in a]
    for start, end in zip(b, np.roll(b, -1, axis=0), strict=True):
        edge, clipped = end - start, []
        sides = [edge[0] * (y - start[1]) - edge[1] * (x - start[0]) for x, y in kept]
        for k, (point, side) in enumerate(zip(kept, sides, strict=True)):
            before, side_before = kept[k - 1], sides[k - 1]
            if (side > 0) != (side_before > 0):
                t = side_before / (side_before - side)
                clipped.append((before[0] + t * (point[0] - before[0]), before[1] + t * (point[1] - before[1])))
            if side > 0:
                clipped.append(point)
        kept = clipped
        if len(kept) < 3:
            return None
    return np.array(kept)


def area(polygon: Float64) -> float:
    """The area of a polygon of (n, 2) corners in order; not negative."""
    x, y = polygon.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def _unit(vector: Float64) -> Float64:
    """The vector scaled to length 1."""
    found: Float64 = vector / np.linalg.norm(vector)
    return found
