"""Report notes on nodes and compounds, which can be written once the graph is known."""

from __future__ import annotations

from wall.importers.equalizer.compounds import EVERYTHING, SHARING, Compound
from wall.importers.equalizer.grammar import Statement
from wall.importers.equalizer.resolved_values import ResolvedPanel
from wall.importers.equalizer.resources import Resources

SOURCE_ONLY = "its channels only draw: which machine a renderer runs on is said to mpirun (a hostfile), not here"


def note_nodes(config: Statement, resources: Resources, used: set[int], hosts: set[str]) -> None:
    """Report channels as panels, ranks or unused, and nodes, pipes and windows as their channels.

    `used`: identities of the channels that render or join; `hosts`: machines that the graph names.
    """
    for channel in resources.channels:
        if channel.statement.carried is None and id(channel) in used:
            channel.statement.carry("a renderer")
        elif channel.statement.carried is None:
            channel.statement.drop("no panel shows it and none is drawn by it")
    for block in config.walk():
        if block.word not in ("appNode", "node", "pipe", "window") or block.body is None:
            continue
        channels = [one for one in block.walk() if one.word == "channel" and one.body is not None]
        if any(one.carried for one in channels):
            block.carry()
        else:
            block.drop("none of its channels is used" if channels else "it has no channel")
        if block.word in ("appNode", "node"):
            _note_host(block, any(one.why.startswith("panel ") for one in channels), hosts)


def _note_host(node: Statement, shows: bool, hosts: set[str]) -> None:
    """Report a node's host names: carried with its panels, or with the joins that run there."""
    for one in node.walk() if node.carried and not shows else ():
        if one.word in ("host", "hostname") and one.carried and one.values[0] in hosts:
            one.carry("where nodes of the graph run")
        elif one.word in ("host", "hostname"):
            one.drop(SOURCE_ONLY)
        elif one.word == "connection" and not any(field.values[0] in hosts for field in one.all("hostname")):
            one.carried = None


def note_compounds(panels: list[ResolvedPanel]) -> None:
    """Report compounds: those that render as ranks, those above them by what their parts became."""
    for one in panels:
        for part, draws in one.leaves.items():
            for draw in draws:
                share = "" if part == EVERYTHING else f" of the scene's part {part[0]:g} to {part[1]:g}"
                draw.leaf.statement.carry(f"a rank{share} for panel {one.part.id}")
    for one in panels:
        for root in one.part.destination.roots:
            _note_compound(root, one.part.id)


def _note_compound(compound: Compound, panel: str) -> None:
    """Report a compound of a panel, the compounds below it, and their frames."""
    block = compound.statement
    for child in compound.children:
        _note_compound(child, panel)
    if block.carried is None:
        exchanges = block.all("inputframe", "outputframe")
        if compound.parent and compound.channel and not (compound.draws or block.all("outputframe")):
            block.drop("a window that shows again what a panel shows" if exchanges else "it draws nothing")
        elif any(child.statement.carried for child in compound.children) or exchanges:
            block.carry(f"a part of panel {panel}" if compound.parent else f"panel {panel}")
        else:
            block.drop("nothing takes what it draws" if compound.draws else "it draws nothing")
    for word in ("inputframe", "outputframe"):
        for frame in block.all(word):
            if frame.carried is None:
                frame.carry("an edge of the graph")
                frame.text("name")
            frame.numbers("viewport")
            if (buffers := frame.last("buffer")) is not None:
                buffers.carry()
    if any(block.all(word) for word in SHARING):
        block.why = block.why + ", of a region of its own"
