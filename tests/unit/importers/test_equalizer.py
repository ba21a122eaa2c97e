"""Whole Equalizer files: what comes out is a configuration that is accepted, and nothing is dropped in silence."""

from __future__ import annotations

import re

import pytest
from equalizer_texts import BINARY_SWAP, DIRECT_SEND, HYBRID, STREAM, WALL, draws, one_panel, pipes, server, takes

from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.geometry.expanding import expand
from wall.importers.command import convert_text
from wall.importers.equalizer import convert
from wall.importers.equalizer.conversion_report import described
from wall.importers.equalizer.grammar import parse
from wall.importers.formats import detect
from wall.importers.report import NotThisFormat

EVERYTHING = """#Equalizer 1.2 ascii
# every kind of block, most of their words
global
{
    EQ_CONFIG_FATTR_EYE_BASE .062
    EQ_CONFIG_IATTR_ROBUSTNESS OFF
    EQ_CONNECTION_IATTR_TYPE RDMA
    EQ_NODE_CATTR_LAUNCH_COMMAND_QUOTE '%'
    EQ_NODE_IATTR_HINT_AFFINITY CORE 2
    EQ_WINDOW_IATTR_HINT_SWAPSYNC OFF
    EQ_COMPOUND_IATTR_STEREO_ANAGLYPH_LEFT_MASK [ RED GREEN ]
}
server
{
    connection { type TCPIP hostname "head" port 4242 bandwidth 100000 }
    config
    {
        name "all of it"
        latency 2
        attributes { robustness ON }
        appNode
        {
            name "head"
            attributes { thread_model DRAW_SYNC launch_command "ssh -n %h %c" launch_timeout 9 }
            pipe
            {
                port 0 device 1 viewport [ 0 0 2560 1440 ]
                attributes { hint_thread ON hint_cuda_GL_interop OFF future_attribute [ a 2 ] }
                window
                {
                    name "front"
                    attributes { hint_stereo AUTO planes_samples 4 hint_drawable window }
                    channel { name "left" viewport [ 0 0 .5 1 ] attributes { hint_sendtoken OFF dump_image "x.png" } }
                    channel { name "right" viewport [ .5 0 .5 1 ] drawable [ FBO_COLOR ] }
                }
            }
        }
        node
        {
            host "render1"
            connection { hostname "render1-ib" interface "ib0" }
            connection { hostname "render1" filename "pipe" type PIPE }
            pipe { window { channel { name "help" } channel { name "spare" } } }
        }
        node { host "nothing" }
        observer
        {
            name "who" eye_base .07 focus_distance 2 focus_mode relative_to_origin opencv_camera OFF vrpn_tracker "h@x"
        }
        layout { name "now" view { name "v" mode MONO observer "who" attributes { DisplayCluster "y" } } }
        layout { name "later" view { } }
        canvas
        {
            name "both" layout "now" layout "later" swapbarrier { NV_group 1 NV_barrier 1 }
            wall { bottom_left [ -1 -.5 -1 ] bottom_right [ 1 -.5 -1 ] top_left [ -1 .5 -1 ] type fixed }
            segment { name "l" channel "left" viewport [ 0 0 .5 1 ] }
            segment { name "r" channel "right" viewport [ .5 0 .5 1 ] swapbarrier {} }
        }
        compound
        {
            name "wall"
            compound
            {
                channel ( canvas "both" segment "l" layout "now" view "v" )
                tree_equalizer { mode 2D damping .3 boundary [ 8 8 ] resistance .1 }
                compound {}
                compound { channel "help" zoom [ .5 .5 ] outputframe { type memory buffer [ COLOR ] zoom [ 1 1 ] } }
                inputframe { name "frame.help" }
            }
            compound
            {
                channel ( segment "r" )
                tile_equalizer { name "q" size [ 64 64 ] }
                chunk_equalizer { size 0.01 distribution_strategy EQUAL }
                outputtiles { name "q" size [ 64 64 ] }
                compound { inputtiles { name "q" } }
                attributes { stereo_mode PASSIVE update_FOV ON }
            }
        }
        compound { channel ( layout "later" ) swapbarrier { name "s" } }
    }
    config { appNode { } }
}
"""

FILES = {
    "everything": EVERYTHING,
    "sort-first": one_panel("compound { viewport [ 0 0 1 .5 ] }" + draws("b", "viewport [ 0 .5 1 .5 ]") + takes("b")),
    "direct-send": one_panel(DIRECT_SEND),
    "binary-swap": one_panel(BINARY_SWAP),
    "stream": one_panel(STREAM),
    "hybrid": one_panel(HYBRID),
    "stereo": one_panel("", mode="mode STEREO"),
    "stereo sort-last": one_panel(DIRECT_SEND, mode="mode STEREO"),
    "no canvas": server(pipes("ab"), f'compound {{ channel "a" {WALL} }} compound {{ channel "b" {WALL} }}'),
    "channels alone": server(pipes("abc")),
}


@pytest.mark.parametrize("name", FILES)
def test_the_result_is_accepted(name: str) -> None:
    chosen, conversion, _ = convert_text(FILES[name], f"{name}.eqc")
    assert chosen.name == "equalizer"
    assert conversion.ranks == convert(FILES[name], name).ranks


@pytest.mark.parametrize("name", FILES)
def test_every_statement_is_carried_or_not_with_its_line(name: str) -> None:
    conversion = convert(FILES[name], "f.eqc")
    told = sorted((item.line, item.what) for item in (*conversion.carried, *conversion.not_carried))
    silent = {"server", "config", "global", "attributes", "projection"}  # they only hold others
    wanted = [one for one in parse(FILES[name], "f.eqc").walk() if one.word != "file"]
    missing = [
        one for one in wanted if (one.line, described(one)) not in told and not (one.word in silent and one.body)
    ]
    assert not missing, [described(one) for one in missing]
    assert all(item.why for item in conversion.not_carried)
    assert len(told) == len(set(told)) or name != "everything"


@pytest.mark.parametrize(
    ("line", "what", "why"),
    [
        ("EQ_WINDOW_IATTR_HINT_SWAPSYNC", "global / EQ_WINDOW_IATTR_HINT_SWAPSYNC OFF", "swap with their display"),
        ("type TCPIP", "connection", "launcher"),
        ("future_attribute", "/ future_attribute a 2", "does not name"),
        ("tree_equalizer", "compound \"wall\" / compound / tree_equalizer", "load balance"),
        ("outputtiles", "/ outputtiles \"q\"", "load balance"),
        ("channel \"help\" zoom", "/ zoom 0.5 0.5", "their own resolution"),
        ("layout { name \"later\"", "layout \"later\" / view", "not switched"),
        ("node { host \"nothing\"", "node", "no channel"),
        ("channel { name \"spare\"", "channel \"spare\"", "no panel shows it"),
        ("host \"render1\"", "node / host \"render1\"", "hostfile"),
        ("config { appNode", "config", "one wall a file"),
        ("swapbarrier { NV_group", "/ swapbarrier", "graph.sync"),
    ],
)  # fmt: skip
def test_statements_not_carried_have_a_reason(line: str, what: str, why: str) -> None:
    number = next(k for k, text in enumerate(EVERYTHING.splitlines(), 1) if line in text)
    items = [
        item for item in convert(EVERYTHING, "f.eqc").not_carried if item.line == number and item.what.endswith(what)
    ]
    assert any(why in item.why for item in items), [item.why for item in items]


def test_a_block_that_is_left_out_carries_nothing_of_its_own() -> None:
    conversion = convert(EVERYTHING, "f.eqc")
    left = {(item.line, item.what) for item in conversion.not_carried if item.what.count(" / ") == 0}
    for item in conversion.carried:
        assert (item.line, item.what.split(" / ")[0]) not in left


def test_sort_last_for_two_eyes_is_cut_where_each_eyes_panel_lies() -> None:
    _, _, yaml = convert_text(FILES["stereo sort-last"], "f.eqc")
    config = loads(yaml).config
    areas = {tuple(node.area) for node in config.graph.nodes if getattr(node, "area", None)}
    for panel in expand(config.wall).panels:
        (x, y), (w, h) = panel.screen, panel.pixels
        assert {(x, y, w, h // 2), (x, y + h // 2, w, h // 2)} <= areas


@pytest.mark.parametrize("name", ["direct-send", "binary-swap", "stream", "hybrid"])
def test_channels_that_draw_or_join_are_carried(name: str) -> None:
    carried = convert(FILES[name], "f.eqc").carried
    told = {item.what[-3:]: item.why for item in carried if re.fullmatch(r'appNode / .* / channel "."', item.what)}
    used = "ab" if name == "direct-send" else "abcd"
    assert told == {f'"{one}"': "panel a" if one == "a" else "a renderer" for one in used}


@pytest.mark.parametrize("text", [FILES["sort-first"], FILES["sort-first"].split("\n", 1)[1]])
def test_a_file_is_known_by_what_it_says_or_by_its_name(text: str) -> None:
    assert detect(text, "wall.txt").name == detect(text, "wall.eqc").name == "equalizer"


@pytest.mark.parametrize("text", ["{}", "hello", "<configuration/>"])
def test_a_file_with_this_suffix_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(NotThisFormat):
        convert_text(text, "wall.eqc")


def test_an_error_keeps_its_position() -> None:
    with pytest.raises(ConfigError, match=r"^wall\.eqc:2:8: 'confg' came"):
        convert_text("server {\n       confg { } }", "wall.eqc")


def test_strips_are_joined_on_the_machines_that_the_file_names() -> None:
    nodes = (f'node {{ host "node{one}" pipe {{ window {{ channel {{ name "{one}" }} }} }} }}' for one in "abcd")
    frame = f'layout {{ view {{}} }} canvas {{ layout 0 {WALL} segment {{ channel "a" }} }}'
    text = server(*nodes, frame, f"compound {{ channel ( segment 0 ) {BINARY_SWAP} }}")
    _, conversion, _ = convert_text(text, "f.eqc")
    depths = [node for node in conversion.values["graph"]["nodes"] if node["op"] == "depth"]
    assert {node["on"] for node in depths} == {"head", "host nodeb", "host nodec", "host noded"}
    assert conversion.values["wall"]["panels"][0]["host"] == "nodea"
    assert not any('host "' in item.what for item in conversion.not_carried)
