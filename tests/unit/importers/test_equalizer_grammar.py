"""The language of Equalizer's configurations: all its words are read, and mistakes are shown where they stand."""

from __future__ import annotations

import pytest
from equalizer_texts import BINARY_SWAP, draws, one_panel, pipes, server, takes
from hypothesis import given, settings
from hypothesis import strategies as st

from wall.core.errors import ConfigError
from wall.importers.equalizer import convert
from wall.importers.equalizer.grammar import Statement, parse
from wall.importers.equalizer.language import ALIASES, BLOCKS, SETTINGS, Rule
from wall.importers.report import NotThisFormat

# every keyword of eq/server/loader.l (2.1) but the EQ_... ones, which any spelling of passes, and the punctuation
KEYWORDS = """
global server config appNode node pipe window attributes hint_decoration hint_doublebuffer hint_fullscreen
hint_statistics hint_sendtoken hint_core_profile hint_opengl_major hint_opengl_minor hint_stereo hint_swapsync
hint_drawable hint_thread hint_affinity hint_cuda_GL_interop hint_screensaver hint_grab_pointer planes_alpha
planes_color planes_depth planes_stencil planes_accum planes_accum_alpha planes_samples ON OFF AUTO CORE SOCKET FASTEST
NICEST QUAD ANAGLYPH anaglyph PASSIVE RED GREEN BLUE HORIZONTAL VERTICAL DPLEX DFR DDS framerate channel observer layout
view canvas segment compound loadBalancer DFR_equalizer framerate_equalizer load_equalizer tree_equalizer
monitor_equalizer view_equalizer tile_equalizer damping connection name type TCPIP SDP PIPE RSP RDMA UDT texture memory
fixed relative_to_observer relative_to_origin HMD host hostname interface launch_command launch_command_quote
launch_timeout TCPIP_port port PIPE_filename filename task eye eye_base eye_left eye_cyclop eye_right focus_distance
focus_mode opencv_camera vrpn_tracker robustness buffer CLEAR DRAW CYCLOP LEFT RIGHT ASSEMBLE READBACK COLOR DEPTH
viewport range period phase pixel subpixel bandwidth device wall bottom_left bottom_right top_left projection origin
distance fov hpr latency swapbarrier NV_group NV_barrier outputframe inputframe outputtiles inputtiles stereo_mode
stereo_anaglyph_left_mask stereo_anaglyph_right_mask update_FOV FBO RGBA16F RGBA32F pbuffer thread_model ASYNC async
DRAW_SYNC draw_sync LOCAL_SYNC local_sync mode boundary resistance 2D assemble_only_limit DB zoom MONO STEREO size
DisplayCluster dump_image drawable FBO_COLOR FBO_DEPTH FBO_STENCIL
"""


def example_of(rule: Rule) -> str:
    """Something that may follow a word with this rule."""
    return {
        "block": "{ }",
        "string": '"x-1 & 2"',
        "character": "'\"'",
        "number": "-.5",
        "whole": "7",
        "setting": "NICEST",
        "numbers": "[ " + " ".join(["1.", ".5", "-2", "+3.25"][: rule.count]) + " ]",
        "wholes": "[ " + " ".join("1234"[: rule.count]) + " ]",
        "words": "[ " + " ".join(rule.words) + " ]",
        "word": rule.words[-1] if rule.words else "",
        "connection": "RDMA",
        "reference": '"by name"',
        "channel": "( segment 0 view 1 )",
        "bound": "[ 4 4 ]",
        "path": "( )",
    }[rule.form]


def way_to(block: str) -> list[tuple[str, Rule]]:
    """Words that lead from the file into a block."""
    ways: dict[str, list[tuple[str, Rule]]] = {"file": []}
    queue = ["file"]
    while queue:
        here = queue.pop(0)
        for word, rule in BLOCKS[here].items():
            if rule.block and rule.block not in ways:
                ways[rule.block] = [*ways[here], (word, rule)]
                queue.append(rule.block)
    return ways[block]


def inside(block: str, text: str) -> str:
    """A file with this text in such a block, and a server."""
    for word, rule in reversed(way_to(block)):
        text = f"{word} ( {text} )" if rule.form == "channel" else f"{word} {{ {text} }}"
    return text + (" server { }" if not text.startswith(("server", "config")) else "")


@pytest.mark.parametrize("block", BLOCKS)
def test_every_word_is_read_wherever_it_may_stand(block: str) -> None:
    for word, rule in BLOCKS[block].items():
        top = parse(inside(block, f"{word} {example_of(rule)}"), "f.eqc")
        assert word in [one.word for one in top.walk()]


@pytest.mark.parametrize("word", ["tile_equalizer", "chunk_equalizer", "outputtiles", "inputchunks"])
def test_sizes_of_tiles_and_chunks_are_pixels_or_a_share(word: str) -> None:
    """Equalizer 2.1 writes `size [ 64 64 ]` for tiles; a variant with chunks writes `size 0.01` for these."""
    for written, values in (("[ 64 32 ]", [64.0, 32.0]), ("0.01", [0.01])):
        top = parse(f'config {{ compound {{ {word} {{ name "q" size {written} }} }} }}', "f.eqc")
        assert [one.values for one in top.walk() if one.word == "size"] == [values]
    for wrong in ("[ 64 ]", "[ 0.1 0.1 ]", "large"):
        with pytest.raises(ConfigError, match="size"):
            parse(f"config {{ compound {{ {word} {{ size {wrong} }} }} }}", "f.eqc")


def test_no_keyword_of_the_language_is_missing() -> None:
    words = {word for block in BLOCKS.values() for word in block} | set(SETTINGS) | set(ALIASES) | {"CORE", "SOCKET"}
    words |= {word for block in BLOCKS.values() for rule in block.values() for word in rule.words}
    assert words >= set(KEYWORDS.split())


def test_global_attributes_of_any_version_are_read_and_keep_their_line() -> None:
    text = (
        'global {\n EQ_CONFIG_FATTR_EYE_BASE .1\n EQ_VIEW_SATTR_DEFLECT_HOST "a"\n EQ_NODE_IATTR_X CORE 3\n}\nserver{}'
    )
    top = parse(text, "f.eqc")
    assert [(one.word, one.line, one.values) for one in top.all("global")[0].body or ()] == [
        ("EQ_CONFIG_FATTR_EYE_BASE", 2, [0.1]),
        ("EQ_VIEW_SATTR_DEFLECT_HOST", 3, ["a"]),
        ("EQ_NODE_IATTR_X", 4, ["CORE", 3.0]),
    ]


def test_comments_of_both_kinds_and_a_missing_last_newline_are_no_trouble() -> None:
    top = parse('server // all "that"\n{ # { }\n config { name "#1 // x" } } # end', "f.eqc")
    assert [one.values for one in top.walk() if one.word == "name"] == [["#1 // x"]]


def test_older_spellings_are_equivalent() -> None:
    top = parse("config { compound { buffers [ COLOR ] outputFrame {} } }", "f.eqc")
    assert [one.word for one in top.walk()][2:] == ["compound", "buffer", "outputframe"]


@pytest.mark.parametrize(
    ("text", "place", "told"),
    [
        ("server { config { nod { } } }", "1:19", "did you mean node?"),
        ("server {\n  config { latency .5 } }", "2:20", "'.5' came; wanted: a whole number after latency"),
        ("config { compound { viewport [ 0 0 1 ] } }", "1:38", "']' came; wanted: [ and 4 numbers ] after viewport"),
        ("config { compound { eye [ MIDDLE ] } }", "1:27", "any of CYCLOP, LEFT, RIGHT"),
        ("config { node { host 7 } }", "1:22", 'a text such as "name" after host'),
        ('config { node { host "open } }', "1:22", "'\"open } }' came; wanted: a word, a number or a text"),
        ("config {\n node {\n", "3:1", "the file ends in node, begun on line 2; wanted: }"),
        ("server { } }", "1:12", "'}' came"),
        ("config { latency 99999999999 }", "1:18", "a whole number after latency"),
        ("config { observer { eye_base 1e99 } }", "1:30", "too large"),
        ("config { node { attributes { hint_affinity CORE x } } }", "1:49", "'x' came"),
    ],
)
def test_an_error_names_its_position_and_what_was_wanted(text: str, place: str, told: str) -> None:
    with pytest.raises(ConfigError) as refused:
        parse(text, "wall.eqc")
    assert str(refused.value).startswith(f"wall.eqc:{place}: ")
    assert told in str(refused.value)


@pytest.mark.parametrize(
    "text", ['{"nodes": []}', "<pvx></pvx>", "", "wall:\n  grid: {}\n", "\x00\x01", "# only words"]
)
def test_another_format_is_not_taken_for_this_one(text: str) -> None:
    with pytest.raises(NotThisFormat, match=r"^f\.eqc:\d+:\d+: "):
        parse(text, "f.eqc")


def test_nested_without_end_is_refused_before_the_stack_is_full() -> None:
    with pytest.raises(ConfigError, match="nested"):
        parse("config { " + "compound { " * 5000, "f.eqc")


@pytest.mark.parametrize(
    ("compounds", "told"),
    [
        ('compound { channel "nobody" }', 'no channel "nobody"; wanted: "a", "b"'),
        ("compound { compound { channel ( segment 3 ) } }", "no segment 3; wanted: 0 to 0"),
        ('compound { channel ( layout "x" ) }', 'no layout "x"; wanted: 0 to 0'),
        ("compound { channel ( canvas 2 view 0 ) }", "no canvas 2; wanted: 0 to 0"),
    ],
)
def test_a_compound_that_names_what_is_not_there_is_left_out_and_refused_where_it_is_the_only_one(
    compounds: str, told: str
) -> None:
    text = one_panel("", ("a", "b"), more=compounds)
    made = convert(text, "f.eqc")

    assert made.panels == 1
    assert [item.line for item in made.not_carried if told in item.why][:1] == [12]
    with pytest.raises(ConfigError) as refused:
        convert(text.replace("compound { channel ( segment 0 view 0 )\n\n}", ""), "f.eqc")
    assert told in str(refused.value)


def test_a_child_that_names_an_unknown_channel_leaves_the_other_children_their_parts() -> None:
    text = one_panel(draws("b", "range [ 0 .5 ]") + draws("nobody", "range [ .5 1 ]") + takes("b", "nobody"))

    made = convert(text, "f.eqc")

    assert made.panels == 1
    assert [item.line for item in made.not_carried if 'no channel "nobody"' in item.why and "range" in item.what] == [
        text[: text.index("nobody")].count("\n") + 1
    ]


def test_a_config_without_channels_shows_nothing_and_is_refused() -> None:
    with pytest.raises(ConfigError, match="no channel in this config"):
        convert(server("appNode { pipe { } }"), "f.eqc")


TOKENS = '[A-Za-z_]+|2D|-?[0-9.]+|"[a-z]*"|[{}()\\[\\]]'


@given(st.data())
@settings(max_examples=150, deadline=None)
def test_whatever_is_done_to_a_file_it_converts_or_is_refused(data: st.DataObject) -> None:
    words = (pipes("abcd") + one_panel(BINARY_SWAP)).split()
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(words) - 1))
        change = data.draw(st.sampled_from(["drop", "twice", "word", "swap"]))
        if change == "drop":
            del words[at]
        elif change == "twice":
            words.insert(at, words[at])
        elif change == "word":
            words[at] = data.draw(st.from_regex(TOKENS, fullmatch=True))
        else:
            other = data.draw(st.integers(0, len(words) - 1))
            words[at], words[other] = words[other], words[at]
    text = " ".join(words)
    told = "f.eqc:"
    try:
        made = convert(text, "f.eqc").panels
    except ConfigError as refused:
        made, told = 0, str(refused)
    assert made >= 1 or told != "f.eqc:"
    assert told.startswith("f.eqc:")


def test_statements_keep_their_position() -> None:
    top = parse("server {\n  config {\n    latency 3 } }", "f.eqc")
    latency = next(one for one in top.walk() if one.word == "latency")
    assert (latency.line, latency.column) == (3, 5)
    assert isinstance(latency.parent, Statement)
    assert latency.parent.word == "config"
