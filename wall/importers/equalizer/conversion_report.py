"""The conversion report: every statement of the source as carried or not carried, with its line and the reason."""

from __future__ import annotations

from collections.abc import Mapping

from wall.importers.equalizer.grammar import Statement, shown_values
from wall.importers.report import Item

_BALANCE = "load balance: ranks share a panel evenly"
_PROCESS = "how processes are started and joined is the launcher's: mpirun, or wall run by itself"
_WINDOW = "a window's frame buffer is not described here"
_THREAD = "threads are not placed here"
_STEREO = "how one display shows two eyes is not set here"
REASONS: Mapping[str, str] = {
    "connection": _PROCESS, "hostname": _PROCESS, "interface": _PROCESS, "port": _PROCESS, "bandwidth": _PROCESS,
    "filename": _PROCESS, "type": "a frame's or connection's kind is the transport's own choice",
    "launch_command": _PROCESS, "launch_command_quote": _PROCESS, "launch_timeout": _PROCESS,
    "thread_model": _THREAD, "hint_thread": _THREAD, "hint_affinity": _THREAD,
    "latency": "no frames are counted here, so none run ahead",
    "robustness": "lost ranks never stop a run here",
    "hint_swapsync": "windows swap with their display", "hint_statistics": "statistics are an overlay of the page",
    "hint_stereo": _STEREO, "stereo_mode": _STEREO, "stereo_anaglyph_left_mask": _STEREO,
    "stereo_anaglyph_right_mask": _STEREO, "hint_decoration": "windows have no frame here",
    "update_FOV": "Equalizer ignores it as well",
    "focus_distance": "the plane in which both eyes meet is the wall", "focus_mode": "both eyes meet in the wall",
    "opencv_camera": "no head tracking", "vrpn_tracker": "no head tracking",
    "DisplayCluster": "pictures are not streamed to other walls", "deflect_host": "pictures are not streamed to other "
    "walls", "dump_image": "the recorder sink writes pictures",
    "swapbarrier": "nothing waits for a frame here; graph.sync: frame would", "NV_group": "no swap groups",
    "NV_barrier": "no swap groups", "boundary": _BALANCE, "resistance": _BALANCE, "damping": _BALANCE,
    "assemble_only_limit": _BALANCE, "framerate": _BALANCE, "mode": _BALANCE, "load_equalizer": _BALANCE,
    "tree_equalizer": _BALANCE, "loadBalancer": _BALANCE, "DFR_equalizer": _BALANCE + ", at full resolution",
    "framerate_equalizer": "load balance: every rank sends what it has at once", "view_equalizer": _BALANCE,
    "tile_equalizer": _BALANCE, "tiles": _BALANCE, "size": _BALANCE, "outputtiles": _BALANCE, "inputtiles": _BALANCE,
    "chunk_equalizer": _BALANCE, "outputchunks": _BALANCE, "inputchunks": _BALANCE, "distribution_strategy": _BALANCE,
    "monitor_equalizer": "load balance: panels are not shown again, scaled",
    "zoom": "panels are rendered at their own resolution",
    "period": "time-multiplex: its ranks share every picture instead", "phase": "time-multiplex: its ranks share "
    "every picture instead", "pixel": "its ranks share the panel, each its own region, not every other pixel",
    "subpixel": "its ranks share the panel, each its own region, not a sample of every pixel",
    "drawable": _WINDOW, "name": "a label only", "observer": "nobody looks at this place in the configuration",
}  # fmt: skip
_PARTS = ("wall", "projection", "attributes", "server", "config", "global", "file")  # say nothing by themselves


def report_items(top: Statement) -> tuple[list[Item], list[Item]]:
    """The items that were carried and those that were not, in the order of the source."""
    carried, left = [], []
    for one in top.walk():
        above = one.parent
        if above is not None and above.carried is False:
            one.drop(one.why if one.carried is False and one.why else above.why)
        elif one.carried is None:
            _decide(one)
        if one.carried:
            carried.append(Item(what=described(one), line=one.line, why=one.why))
        elif one.carried is False:
            left.append(Item(what=described(one), line=one.line, why=one.why))
    return carried, left


def described(one: Statement) -> str:
    """A statement with its values and the blocks around it: node "render1" / pipe / device 1."""
    text = _named(one)
    if one.values:
        text += " " + (f'"{one.values[0]}"' if one.word in ("name", "channel", "host") else shown_values(one))
    above = one.parent
    while above is not None and above.word not in ("file", "config", "server"):
        text, above = f"{_named(above)} / {text}", above.parent
    return text


def _named(one: Statement) -> str:
    """A statement's word, with the name of its block if it has one."""
    names = [child.values[0] for child in one.body or () if child.word == "name" and child.values]
    return f'{one.word} "{names[-1]}"' if names else one.word


def _decide(one: Statement) -> None:
    """Report a statement that the converter did not read as not carried, with the reason of its word."""
    if one.word in _PARTS:
        if not one.body:
            one.carry("empty")
    elif not one.known:
        one.drop("an attribute that Equalizer's loader does not name")
    elif one.word in REASONS:
        one.drop(REASONS[one.word])
    elif one.word.startswith(("hint_", "planes_")):
        one.drop(_WINDOW)
    elif one.word.startswith("EQ_"):
        one.drop(_of_global(one.word))
    else:
        one.drop("nothing that is shown uses it")


def _of_global(word: str) -> str:
    """The reason for a global default: that of the attribute whose name it ends in."""
    own = word.split("ATTR_")[-1].lower()
    if own in REASONS:
        return REASONS[own]
    if word.startswith(("EQ_CONNECTION", "EQ_NODE")):
        return _PROCESS
    return _WINDOW if word.startswith("EQ_WINDOW") else "a default for all, which nothing here uses"
