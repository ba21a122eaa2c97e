"""Small Equalizer configurations, put together from parts: who draws, on what wall, with which compounds."""

from __future__ import annotations

from collections.abc import Sequence

WALL = "wall { bottom_left [ -.4 -.3 -1 ] bottom_right [ .4 -.3 -1 ] top_left [ -.4 .3 -1 ] }"


def pipes(names: Sequence[str], viewport: str = "0 0 400 300") -> str:
    """An application node with a pipe and a window of its own for each channel."""
    windows = (f'pipe {{ window {{ viewport [ {viewport} ] channel {{ name "{name}" }} }} }}\n' for name in names)
    return f"appNode {{ {''.join(windows)} }}\n"


def server(*parts: str) -> str:
    """A whole file."""
    return "#Equalizer 1.1 ascii\nserver\n{ config {\n" + "\n".join(parts) + "\n} }\n"


def one_panel(compounds: str, names: Sequence[str] = ("a", "b", "c", "d"), *, mode: str = "", more: str = "") -> str:
    """One segment on channel `a`, with this inside its compound, and more after it."""
    layout = f"observer {{}} layout {{ view {{ observer 0 {mode} }} }}"
    canvas = f'{layout} canvas {{ layout 0 {WALL} segment {{ channel "a" }} }}'
    return server(pipes(names), canvas, f"compound {{ channel ( segment 0 view 0 )\n{compounds}\n}}", more)


def draws(name: str, *words: str) -> str:
    """A compound that draws on a channel and gives its frame."""
    return f'compound {{ channel "{name}" {" ".join(words)} outputframe {{}} }}\n'


def takes(*names: str) -> str:
    """Input frames by their default names."""
    return " ".join(f'inputframe {{ name "frame.{name}" }}' for name in names)


DIRECT_SEND = """
buffer [ COLOR DEPTH ]
compound { channel "b"
  compound { range [ 0 .5 ] outputframe { name "low.b" viewport [ 0 0 1 .5 ] } }
  inputframe { name "high.a" }
  outputframe { buffer [ COLOR ] viewport [ 0 .5 1 .5 ] }
}
compound { range [ .5 1 ] outputframe { name "high.a" viewport [ 0 .5 1 .5 ] } }
inputframe { name "low.b" } inputframe { name "frame.b" }
"""

BINARY_SWAP = """
buffer [ COLOR DEPTH ]
compound {
  compound { range [ 0 .25 ] outputframe { name "1a" viewport [ 0 0 1 .5 ] } }
  compound { task [ ASSEMBLE READBACK ] inputframe { name "1b" } outputframe { name "2a" viewport [ 0 .5 1 .25 ] } }
}
compound { channel "b"
  compound { range [ .25 .5 ] outputframe { name "1b" viewport [ 0 .5 1 .5 ] } }
  compound { task [ ASSEMBLE READBACK ] inputframe { name "1a" } outputframe { name "2b" viewport [ 0 0 1 .25 ] } }
  inputframe { name "2d" } outputframe { buffer [ COLOR ] viewport [ 0 .25 1 .25 ] }
}
compound { channel "c"
  compound { range [ .5 .75 ] outputframe { name "1c" viewport [ 0 0 1 .5 ] } }
  compound { task [ ASSEMBLE READBACK ] inputframe { name "1d" } outputframe { name "2c" viewport [ 0 .75 1 .25 ] } }
  inputframe { name "2a" } outputframe { buffer [ COLOR ] viewport [ 0 .5 1 .25 ] }
}
compound { channel "d"
  compound { range [ .75 1 ] outputframe { name "1d" viewport [ 0 .5 1 .5 ] } }
  compound { task [ ASSEMBLE READBACK ] inputframe { name "1c" } outputframe { name "2d" viewport [ 0 .25 1 .25 ] } }
  inputframe { name "2b" } outputframe { buffer [ COLOR ] viewport [ 0 0 1 .25 ] }
}
inputframe { name "2c" } inputframe { name "frame.b" } inputframe { name "frame.c" } inputframe { name "frame.d" }
"""

STREAM = (
    "buffer [ COLOR DEPTH ]\n"
    + draws("b", "range [ 0 .25 ]")
    + draws("c", "range [ .25 .5 ]", 'inputframe { name "frame.b" }')
    + draws("d", "range [ .5 .75 ]", 'inputframe { name "frame.c" }')
    + 'compound { range [ .75 1 ] inputframe { name "frame.d" } }'
)

HYBRID = (
    "task [ CLEAR ASSEMBLE ] buffer [ COLOR DEPTH ]\n"
    'compound { task [ CLEAR ] channel "b" }\n'
    "compound { compound { range [ 0 .5 ]\n"
    + draws("d", "viewport [ 0 0 1 .5 ]")
    + draws("b", "viewport [ 0 .5 1 .5 ]")
    + "} compound { range [ .5 1 ]\n"
    + draws("c", "viewport [ 0 0 1 .5 ]")
    + "compound { task [ DRAW READBACK ] viewport [ 0 .5 1 .5 ] } }\n"
    + takes("b", "c", "d")
    + " }"
)
