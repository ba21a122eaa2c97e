"""What can be wrong with where panels stand, and what is only odd. Each with its place in the file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from wall.config.loading import Loaded
from wall.config.views import CameraConfig
from wall.core.errors import ConfigError
from wall.geometry.eyes import eye_of, panel_path, standing_eye
from wall.geometry.folded_overlaps import folded_overlaps
from wall.geometry.panels import Overlap, Panel, Wall
from wall.geometry.surfaces import density

SQUARE = 0.01  # of a pixel's sides; more is seen as a stretched image
COARSE = 0.1  # metres; a coarser pixel is on no display, but in a file whose sizes are millimetres
LEAST_DENSITY, MOST_DENSITY = 0.7, 2.0  # of a flat image: what is coarser blurs, what is finer may alias
LEVEL = 0.7  # cosine of an angle between a camera's up and y that may be a tilted head
ALIGNED = 0.01  # pixels
SAID = 3  # panels that a note names
REFUSED = 8  # overlaps that are told one by one


def check_wall(loaded: Loaded, wall: Wall) -> tuple[str, ...]:
    """Notes for a reader: what is odd, but may be meant.

    Raises ConfigError with all that is wrong: panels that cover each other without saying so, eyes behind panels.
    """
    problems = [*_undeclared(loaded, wall), *_on_one_monitor(loaded, wall)]
    for view in range(len(loaded.config.views)):
        try:
            standing_eye(loaded, wall.of_view(view), view)
        except ConfigError as error:
            problems.append(str(error))
    if problems:
        raise ConfigError("\n".join(problems))
    return tuple(note for question in NOTES for note in question(loaded, wall))


def _undeclared(loaded: Loaded, wall: Wall) -> Iterator[str]:
    wrong = [overlap for overlap in wall.overlaps if not overlap.allowed]
    for overlap in wrong[:REFUSED]:
        first, second = wall.panels[overlap.first], wall.panels[overlap.second]
        message = (
            f"pixels covered twice: panels {first.id} and {second.id} share {_metres(overlap.size)} "
            f"({_pixels(overlap, second)} of {second.id}'s pixels), {_declared(overlap)}"
        )
        accepted = "corners that meet, or `overlap` of both where they share light"
        yield str(loaded.error(panel_path(loaded, second), message, accepted))
    if len(wrong) > REFUSED:
        yield f"{loaded.name}: {len(wrong) - REFUSED} more pairs of panels cover each other"


def _on_one_monitor(loaded: Loaded, wall: Wall) -> Iterator[str]:
    """Windows without a place of their own fill their monitor: one would hide the other."""
    first: dict[tuple[object, ...], str] = {}
    for panel in wall.panels:
        shown = panel.config
        if shown.monitor is None or shown.window is not None:
            continue
        other = first.setdefault((shown.host, shown.display, shown.monitor), panel.of)
        if other != panel.of and panel.at == (0, 0):  # of two eyes in one image the first
            came = f"monitor {shown.monitor} shows panel {other}, and {panel.of} would cover it"
            accepted = "a monitor, display or host of its own, or `window` of both: the part that each takes"
            yield str(loaded.error(panel_path(loaded, panel), came, accepted))


def _declared(overlap: Overlap) -> str:
    if not any(overlap.declared):
        return "and do not both declare it"
    return f"and declare {overlap.declared[0]:.4g} m side by side, {overlap.declared[1]:.4g} m above each other"


def _metres(size: tuple[float, float]) -> str:
    return f"{size[0]:.4g} x {size[1]:.4g} m"


def _pixels(overlap: Overlap, panel: Panel) -> str:
    across, down = (max(1, round(size / pitch)) for size, pitch in zip(overlap.size, panel.lit_pitch, strict=True))
    return f"{across} x {down}"


def _stretched(loaded: Loaded, wall: Wall) -> Iterator[str]:
    physical = [(panel, *_pixel(panel)) for panel in wall.panels if panel.of == panel.id]
    found = [panel for panel, across, down in physical if abs(across / down - 1.0) > SQUARE]
    if found:
        across, down = (1000.0 * side for side in _pixel(found[0]))
        yield _note(loaded, found, f"pixels are not square: {across:.4g} mm wide, {down:.4g} mm high")


def _in_millimetres(loaded: Loaded, wall: Wall) -> Iterator[str]:
    found = [panel for panel in wall.panels if panel.of == panel.id and max(_pixel(panel)) > COARSE]
    if found:
        (across, down), (w, h) = _pixel(found[0]), found[0].pixels
        size = f"{across * w:.4g} x {down * h:.4g}"
        yield _note(
            loaded, found, f"is {size} m large, a pixel {across:.3g} m: is that millimetres?", "sizes in metres"
        )


def _pixel(panel: Panel) -> tuple[float, float]:
    """Width and height of what shines, metres."""
    if panel.surface is not None:
        return panel.surface.pitch
    lower_left, lower_right, upper_left = panel.lit
    w, h = panel.pixels
    return float(np.linalg.norm(lower_right - lower_left)) / w, float(np.linalg.norm(upper_left - lower_left)) / h


def _unblended(loaded: Loaded, wall: Wall) -> Iterator[str]:
    """Light that is there twice, where nothing fades out."""
    found: dict[int, Overlap] = {}
    for overlap in wall.overlaps:
        if not all(_fades(wall.panels[k]) for k in (overlap.first, overlap.second)):
            found.setdefault(overlap.second, overlap)
    if found:
        pair = next(iter(found.values()))
        message = f"shares {_metres(pair.size)} of light with panel {wall.panels[pair.first].id}, and not both fade out"
        yield _note(loaded, [wall.panels[k] for k in found], message, "blend: auto")


def _fades(panel: Panel) -> bool:
    ramps = panel.blend is not None and max(panel.blend.across, panel.blend.down) > 0.0
    return ramps or _masked(panel)


def _masked(panel: Panel) -> bool:
    return panel.config.blend_mask is not None


def _needless(loaded: Loaded, wall: Wall) -> Iterator[str]:
    sides = [panel for panel in wall.panels if panel.blend is not None and not _fades(panel)]
    if sides and not any(panel.config.overlap.across or panel.config.overlap.down for panel in wall.panels):
        yield _note(loaded, sides, "blend: auto is as wide as the overlap, and there is none")


def _unaligned(loaded: Loaded, wall: Wall) -> Iterator[str]:
    """Overlaps in which two panels' pixels are not the same ones."""
    pairs = [(wall.panels[o.first], wall.panels[o.second]) for o in wall.overlaps]
    found = {second.index: (first, second) for first, second in pairs if not _share_pixels(first, second)}
    if found:
        first = next(iter(found.values()))[0]
        what = f"its pixels lie between those of panel {first.id}, whose light it shares: the image is less sharp there"
        yield _note(loaded, [second for _, second in found.values()], what)


def _share_pixels(first: Panel, second: Panel) -> bool:
    """Whether two panels that overlap have the same pixels there, those of curved ones to a hundredth."""
    if first.surface is None or second.surface is None:
        return first.plane is second.plane
    pitch = np.array(first.surface.pitch)
    apart = (np.array(second.surface.config.place) - np.array(first.surface.config.place)) / pitch
    steps = np.array(second.surface.pitch) / pitch - 1.0
    return bool(np.abs(apart - np.rint(apart)).max() < ALIGNED and np.abs(steps * max(first.pixels)).max() < ALIGNED)


def _folded(loaded: Loaded, wall: Wall) -> Iterator[str]:
    """Light that is there twice, where nothing can fade out: in planes of their own, or turned in one."""
    if len(wall.faces) == 1:
        return
    for number in range(len(loaded.config.views)):
        panels = wall.of_view(number).panels
        if len(panels) < 2:
            continue
        eye, separation = standing_eye(loaded, wall.of_view(number), number), loaded.config.views[number].eye_separation
        pairs = folded_overlaps(panels, np.array([eye_of(panel, eye, separation) for panel in panels]))
        found = [pair for pair in pairs if not (_masked(pair.first) and _masked(pair.second))]
        if found:
            message = (
                f"lights {_percent(found[0].share)} of its area where the eye also sees panel {found[0].first.id}, "
                "which lies in another plane or surface, or is turned: overlap and blend do not hold, so light adds up"
            )
            later = list({pair.second.index: pair.second for pair in found}.values())
            yield _note(loaded, later, message, "corners that meet as the eye sees them")


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def _coarse(loaded: Loaded, wall: Wall) -> Iterator[str]:
    """Curved panels whose flat image is much coarser, or much finer, than they are."""
    found: dict[str, list[Panel]] = {}
    for number, view in enumerate(loaded.config.views):
        shown = wall.of_view(number).panels
        for panel in shown:
            if panel.surface is None:
                continue
            eye = eye_of(panel, standing_eye(loaded, wall.of_view(number), number), view.eye_separation)
            least, most = density(panel.surface, panel.plane, panel.screen, eye)
            if least < LEAST_DENSITY or most > MOST_DENSITY:
                text = f"its flat image has {least:.2g} to {most:.2g} pixels for one of its own, across or down"
                found.setdefault(text, []).append(panel)
    for text, panels in found.items():
        yield _note(loaded, panels, text, "narrower panels, or an eye nearer to straight before them: about 1")


def _one_eyed(loaded: Loaded, wall: Wall) -> Iterator[str]:
    eyes = {panel.shift for panel in wall.panels}
    for one, other, names in ((-0.5, 0.5, ("left", "right")), (0.5, -0.5, ("right", "left"))):
        if one in eyes and other not in eyes:
            found = [panel for panel in wall.panels if panel.shift == one]
            yield _note(loaded, found, f"shows the {names[0]} eye's image, and no panel the {names[1]} one's")


def _scattered(loaded: Loaded, wall: Wall) -> Iterator[str]:
    if len(wall.faces) > 1 and wall.whole() is not None:
        found = [wall.panels[face[0]] for face in wall.faces[1:]]
        why = "in the wall's image it stands beside the panels before it, not where it is: too far off, or rounding"
        yield _note(loaded, found, why)


def _tilted(loaded: Loaded, wall: Wall) -> Iterator[str]:
    for k, view in enumerate(loaded.config.views):
        up = view.camera.up
        if up[1] >= LEVEL * math.hypot(*up) or _looks_down(view.camera):
            continue
        longest = max(range(3), key=lambda axis: abs(up[axis]))
        letter = "-" * (up[longest] < 0.0) + "xyz"[longest]
        said = (
            f"sky, ground, and lights that no file names keep y upright; scene: {{up: {letter}}} turns .obj, .ply and "
            f".stl models of {letter} up instead, up: {letter} at an entry of scene.data its file"
        )
        yield str(loaded.error(("views", k, "camera", "up"), said))


def _looks_down(camera: CameraConfig) -> bool:
    """Whether a camera looks down, as on a map: then y cannot be up in its image.

    Not one that looks along +y: that is how a world of z up is seen from its front.
    """
    if camera.position is None or camera.target is None:
        return False
    way = [b - a for a, b in zip(camera.position, camera.target, strict=True)]
    return -way[1] > LEVEL * math.hypot(*way)


Question = Callable[[Loaded, Wall], Iterator[str]]
NOTES: tuple[Question, ...] = (
    _in_millimetres,
    _stretched,
    _unblended,
    _needless,
    _unaligned,
    _folded,
    _coarse,
    _one_eyed,
    _scattered,
    _tilted,
)


def _note(loaded: Loaded, panels: Sequence[Panel], message: str, wanted: str = "") -> str:
    """A note at the first of some panels, which names the others."""
    path = panel_path(loaded, panels[0])
    others = [panel.id for panel in panels[1:]]
    rest = f", and {len(others) - SAID} more" if len(others) > SAID else ""
    also = f" (so {', '.join(others[:SAID])}{rest})" if others else ""
    return str(loaded.error(path, f"panel {panels[0].id}: {message}{also}", wanted))
