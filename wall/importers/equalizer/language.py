"""The rules of Equalizer's configuration language: the words of each block, and what follows each word.

Source: the language that Equalizer's server reads (versions 0.6 to 2.1), as its lexer and parser define it, and the
chunks of a variant of it (D. Steiner, 2013 to 2015). Sizes of tiles and of chunks are read in either form, since
nothing here uses them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Form = Literal[
    "block", "string", "character", "number", "whole", "setting", "numbers", "wholes", "words", "word", "reference",
    "channel", "connection", "bound", "path",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Rule:
    """What may follow a word."""

    form: Form
    block: str = ""  # name of the block, for form block and path
    count: int = 0  # how many numbers stand in the brackets
    words: tuple[str, ...] = ()  # which words may stand

    @property
    def wanted(self) -> str:
        """What must follow, for refusals."""
        listed = ", ".join(self.words)
        return {
            "block": "{",
            "path": "(",
            "string": 'a text such as "name"',
            "character": "a character such as '\"'",
            "number": "a number",
            "whole": "a whole number",
            "setting": "ON, OFF, AUTO, a whole number or another setting",
            "numbers": f"[ and {self.count} numbers ]",
            "wholes": f"[ and {self.count} whole numbers ]",
            "words": f"[ and any of {listed} ]",
            "word": f"one of {listed}",
            "reference": 'a text such as "name", or an index' + (f", or {listed}" if listed else ""),
            "channel": 'a channel\'s "name", or ( canvas, segment, layout, view )',
            "connection": f"one of {listed}",
            "bound": "a number, or [ two whole numbers ]",
        }[self.form]


SETTINGS = (
    "ON", "OFF", "AUTO", "FASTEST", "NICEST", "HORIZONTAL", "VERTICAL", "QUAD", "ANAGLYPH", "anaglyph", "PASSIVE",
    "window", "FBO", "pbuffer", "ASYNC", "async", "DRAW_SYNC", "draw_sync", "LOCAL_SYNC", "local_sync", "RGBA16F",
    "RGBA32F", "fixed", "relative_to_origin", "relative_to_observer",
)  # fmt: skip
SWITCHES = ("on", "off", "auto")  # older files write them small
COUNTED_SETTINGS = ("CORE", "SOCKET")  # a number follows

STRING, NUMBER, WHOLE = Rule("string"), Rule("number"), Rule("whole")
SETTING, CHARACTER = Rule("setting"), Rule("character")
VIEWPORT, POINT, PAIR = Rule("numbers", count=4), Rule("numbers", count=3), Rule("numbers", count=2)
EYES = Rule("words", words=("CYCLOP", "LEFT", "RIGHT"))
BUFFERS = Rule("words", words=("COLOR", "DEPTH"))
MASK = Rule("words", words=("RED", "GREEN", "BLUE"))
CONNECTION = Rule("connection", words=("TCPIP", "SDP", "PIPE", "RSP", "RDMA", "UDT", "MCIP"))
REFERENCE = Rule("reference")
STRATEGIES = ("NONE", "EQUAL", "RANDOM", "LOAD_AWARE", "LATENCY_AWARE", "CENT_LOAD_AWARE")
BALANCE = ("2D", "DB", "HORIZONTAL", "VERTICAL")


def _block(name: str) -> Rule:
    """The rule of a word that a block of this name follows."""
    return Rule("block", block=name)


_CONNECTION_FIELDS = {
    "type": CONNECTION, "hostname": STRING, "interface": STRING, "port": WHOLE, "TCPIP_port": WHOLE,
    "bandwidth": WHOLE, "filename": STRING, "PIPE_filename": STRING,
}  # fmt: skip
_FRUSTUM = {"wall": _block("wall"), "projection": _block("projection")}
_EQUALIZERS = {
    "DFR_equalizer": _block("DFR_equalizer"), "framerate_equalizer": _block("empty"),
    "load_equalizer": _block("load_equalizer"), "tree_equalizer": _block("load_equalizer"),
    "monitor_equalizer": _block("empty"), "view_equalizer": _block("empty"), "tile_equalizer": _block("tiles"),
    "chunk_equalizer": _block("tiles"), "loadBalancer": _block("loadBalancer"),
}  # fmt: skip
_LOAD = {
    "damping": NUMBER, "boundary": Rule("bound"), "resistance": Rule("bound"), "assemble_only_limit": NUMBER,
    "mode": Rule("word", words=BALANCE),
}  # fmt: skip
_FRAME = {
    "name": STRING, "type": Rule("word", words=("texture", "memory")), "viewport": VIEWPORT, "buffer": BUFFERS,
    "zoom": PAIR,
}  # fmt: skip
_COMPOUND = {
    "compound": _block("compound"), "name": STRING, "channel": Rule("channel", block="path"),
    "task": Rule("words", words=("CLEAR", "DRAW", "ASSEMBLE", "READBACK")), "eye": EYES,
    "buffer": BUFFERS,
    "viewport": VIEWPORT, "range": PAIR, "period": WHOLE, "phase": WHOLE, "zoom": PAIR,
    "pixel": Rule("wholes", count=4), "subpixel": Rule("wholes", count=2), **_FRUSTUM, **_EQUALIZERS,
    "mode": Rule("words", words=("SYNC",)), "swapbarrier": _block("swapbarrier"),
    "outputframe": _block("frame"), "inputframe": _block("frame"),
    "outputtiles": _block("tiles"), "inputtiles": _block("tiles"),
    "outputchunks": _block("tiles"), "inputchunks": _block("tiles"), "attributes": _block("attributes"),
}  # fmt: skip

BLOCKS: Mapping[str, Mapping[str, Rule]] = {
    "file": {"global": _block("global"), "server": _block("server"), "config": _block("config")},
    "global": {
        "EQ_CONFIG_FATTR_EYE_BASE": NUMBER, "EQ_CONNECTION_IATTR_TYPE": CONNECTION,
        "EQ_NODE_CATTR_LAUNCH_COMMAND_QUOTE": CHARACTER, "EQ_CONNECTION_CATTR_LAUNCH_COMMAND_QUOTE": CHARACTER,
        "EQ_COMPOUND_IATTR_STEREO_ANAGLYPH_LEFT_MASK": MASK, "EQ_COMPOUND_IATTR_STEREO_ANAGLYPH_RIGHT_MASK": MASK,
    },
    "server": {"connection": _block("connection"), "config": _block("config")},
    "config": {
        "appNode": _block("node"), "node": _block("node"), "name": STRING, "observer": _block("observer"),
        "layout": _block("layout"), "canvas": _block("canvas"), "compound": _block("compound"), "latency": WHOLE,
        "attributes": _block("attributes"),
    },
    "connection": _CONNECTION_FIELDS,
    "node": {
        "name": STRING, "host": STRING, "connection": _block("connection"), "pipe": _block("pipe"),
        "attributes": _block("attributes"),
    },
    "pipe": {
        "name": STRING, "port": WHOLE, "device": WHOLE, "viewport": VIEWPORT, "window": _block("window"),
        "attributes": _block("attributes"),
    },
    "window": {
        "name": STRING, "viewport": VIEWPORT, "channel": _block("channel"), "attributes": _block("attributes"),
    },
    "channel": {
        "name": STRING, "viewport": VIEWPORT, "attributes": _block("attributes"),
        "drawable": Rule("words", words=("FBO_COLOR", "FBO_DEPTH", "FBO_STENCIL")),
    },
    "observer": {
        "name": STRING, "eye_base": NUMBER, "eye_left": POINT, "eye_cyclop": POINT, "eye_right": POINT,
        "focus_distance": NUMBER, "focus_mode": SETTING, "opencv_camera": SETTING, "vrpn_tracker": STRING,
    },
    "layout": {"name": STRING, "view": _block("view")},
    "view": {
        "name": STRING, "DisplayCluster": STRING, "mode": Rule("word", words=("MONO", "STEREO")),
        "viewport": VIEWPORT, **_FRUSTUM, "observer": REFERENCE, "attributes": _block("attributes"),
    },
    "canvas": {
        "name": STRING, "layout": Rule("reference", words=("OFF",)), **_FRUSTUM, "segment": _block("segment"),
        "swapbarrier": _block("swapbarrier"),
    },
    "segment": {
        "name": STRING, "channel": STRING, "eye": EYES, "viewport": VIEWPORT, **_FRUSTUM,
        "swapbarrier": _block("swapbarrier"),
    },
    "compound": _COMPOUND,
    "path": {"canvas": REFERENCE, "segment": REFERENCE, "layout": REFERENCE, "view": REFERENCE},
    "wall": {
        "bottom_left": POINT, "bottom_right": POINT, "top_left": POINT,
        "type": Rule("word", words=("fixed", "HMD")),
    },
    "projection": {"origin": POINT, "distance": NUMBER, "fov": PAIR, "hpr": POINT},
    "empty": {},
    "DFR_equalizer": {"damping": NUMBER, "framerate": NUMBER},
    "load_equalizer": _LOAD,
    "loadBalancer": {
        **_LOAD, "mode": Rule("word", words=(*BALANCE, "DPLEX", "DFR", "DDS")), "framerate": NUMBER,
    },
    "tiles": {  # two whole numbers of pixels; of chunks one, the share of the data that is one of them
        "name": STRING, "size": Rule("bound"), "distribution_strategy": Rule("word", words=STRATEGIES),
    },
    "swapbarrier": {"name": STRING, "NV_group": SETTING, "NV_barrier": SETTING},
    "frame": _FRAME,
    "attributes": {
        "eye_base": NUMBER, "robustness": SETTING, "launch_command": STRING, "launch_command_quote": CHARACTER,
        "launch_timeout": SETTING, "thread_model": SETTING, "stereo_mode": SETTING,
        "stereo_anaglyph_left_mask": MASK, "stereo_anaglyph_right_mask": MASK, "update_FOV": SETTING,
        "dump_image": STRING, "DisplayCluster": STRING, "deflect_host": STRING,
        **{f"hint_{name}": SETTING for name in (
            "stereo", "doublebuffer", "fullscreen", "decoration", "swapsync", "drawable", "statistics", "screensaver",
            "grab_pointer", "thread", "affinity", "cuda_GL_interop", "core_profile", "opengl_major", "opengl_minor",
            "sendtoken",
        )},
        **{f"planes_{name}": SETTING for name in (
            "color", "alpha", "depth", "stencil", "accum", "accum_alpha", "samples",
        )},
    },
}  # fmt: skip

ALIASES = {  # the lexer reads buffers as buffer and what is left over it prints: files of its own rely on that
    "buffers": "buffer", "outputFrame": "outputframe", "inputFrame": "inputframe",
}  # fmt: skip
OPEN_BLOCKS = frozenset({"global", "attributes"})  # versions differ in their attributes: others are read and reported
