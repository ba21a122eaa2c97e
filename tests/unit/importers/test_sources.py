"""Trees of JSON5 and XML know every position, and report every node."""

from __future__ import annotations

import pytest

from wall.importers import json_source, xml_source
from wall.importers.report import NotThisFormat
from wall.importers.source import Node, Source, as_number

JSON5 = """// a comment
{
  name: 'first', /* two
  lines */ "size": {"x": 0x10, y: -.5},
  list: [1, +2.0,
    {deep: null}],
}
"""
XML = """<?xml version="1.0" encoding="latin-1"?>
<top>
  <!-- a comment -->
  <part first="1"
        second = 'a > b'/>
  <part>text <inner/></part>
</top>
"""


def at(node: Node) -> tuple[int, int]:
    return node.line, node.column


def test_json5_nodes_know_line_and_column_of_their_keys_and_values() -> None:
    root = json_source.parse(JSON5, "a.json")

    assert at(root) == (2, 1)
    assert at(root.fields["name"]) == (3, 9)
    assert at(root.fields["size"]) == (4, 12)
    assert at(root.fields["list"].items[1]) == (5, 13)
    assert at(root.fields["list"].items[2]) == (6, 5)
    assert root.fields["size"].fields["x"].value == 16
    assert root.fields["size"].fields["y"].value == -0.5
    assert root.fields["list"].items[2].get("deep") is None
    assert root.fields["list"].items[0].name == "list[0]"


def test_xml_attributes_know_their_own_line_and_column() -> None:
    root = xml_source.parse(XML, "a.xml")
    first, second = root.children("part")

    assert at(root) == (2, 1)
    assert at(first.fields["first"]) == (4, 9)
    assert at(first.fields["second"]) == (5, 9)
    assert first.fields["second"].value == "a > b"
    assert first.fields["second"].name == "top.part[0].second"
    assert at(second.items[0]) == (6, 14)
    assert second.fields["#text"].value == "text"


def test_attributes_with_a_mark_in_their_value_do_not_hide_others() -> None:
    root = xml_source.parse('<a b="c=\'d\' e=1" e="2"/>', "a.xml")

    assert at(root.fields["e"]) == (1, 18)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('{"a": 1,\n "b" 2}', ":2:6:"),
        ('{"a": [1,,2]}', ":1:9:"),
        ('{"a": 1} rest', ":1:10:"),
        ('{"a": "x\ny"}', ":1:9:"),
        ('{"a": [1', ":1:9:"),
        ("{\n\x01}", ":2:1:"),
    ],
)
def test_json5_that_is_broken_is_refused_with_its_place(text: str, place: str) -> None:
    with pytest.raises(NotThisFormat, match="not valid JSON5") as caught:
        json_source.parse(text, "w.json")

    assert f"w.json{place}" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<a>\n<b></a>", "w.xml:2:6: not valid XML (mismatched tag)"),
        ("<a/><b/>", "w.xml:1:5: not valid XML (junk after document element)"),
        ("<a b='1' b='2'/>", "w.xml:1:10: not valid XML (duplicate attribute)"),
        ("<!DOCTYPE a [<!ENTITY e 'x'>]><a>&e;</a>", "entities are not read"),
        ("<a>" * 40 + "</a>" * 40, "nested too deeply"),
    ],
)
def test_xml_that_is_broken_or_odd_is_refused_with_its_place(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        xml_source.parse(text, "w.xml")

    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<a " + " ".join(f'b{k}="1"' for k in range(60_000)) + "/>", "w.xml:1:1: more than 50000 elements"),
        ("<a>\n" + "x<b/>" * 60_000 + "</a>", "w.xml:2:249997: more than 50000 elements"),
        ("<?xml" + " " * 1_000_000 + "?><a/>", "w.xml:1:6: not valid XML"),
    ],
)  # fmt: skip
def test_xml_that_would_take_minutes_is_refused_at_once(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        xml_source.parse(text, "w.xml")

    assert says in str(caught.value)


def test_json_nested_too_deeply_is_refused() -> None:
    with pytest.raises(NotThisFormat, match=r"w.json:1:34: nested too deeply"):
        json_source.parse("[" * 40 + "]" * 40, "w.json")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"a": 1, /* ' + "x: 1,\n" * 20 + "}", "w.json:1:10: not valid JSON5 (this comment is never closed)"),
        ("{a: 1,\n b: 'x, /* */ }", "w.json:2:5: not valid JSON5 (this string is never closed)"),
        ('{"a": "x\\"}', "w.json:1:7: not valid JSON5 (this string is never closed)"),
        ("/*" * 500_000, "w.json:1:360001: more than 120000 words, signs and blanks"),
        ("[" + "+ " * 300_000, "w.json:1:120001: more than 120000 words, signs and blanks"),
        ("{a: 1" + "e1" * 500_000 + "}", "w.json:1:5: a number of more than 400 characters"),
    ],
)  # fmt: skip
def test_json_that_would_take_the_library_minutes_or_years_is_refused_before_it(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        json_source.parse(text, "w.json")

    assert says in str(caught.value)


def test_comments_of_json_become_blanks_and_strings_stay_as_they_are() -> None:
    text = "{a: '/* no */', // one\n b: \"it's // \\\" \", /* two\n lines */ c: 1}"

    kept = json_source.without_comments(text, "w.json")

    assert kept == "{a: '/* no */',       \n b: \"it's // \\\" \",       \n          c: 1}"
    assert at(json_source.parse(text, "w.json").fields["c"]) == (3, 14)


def test_more_lists_than_any_wall_has_are_refused_before_they_are_read() -> None:
    with pytest.raises(NotThisFormat, match="more than 120000 words, signs and blanks"):
        json_source.parse("[" + "[]," * 60_000 + "]", "w.json")


def test_nodes_that_were_never_read_are_listed_with_every_value_inside() -> None:
    source = Source(
        "w.json", json_source.parse("{a: 1,\n b: {c: 2,\n d: {e: 3}},\n f: {g: [4, 5]}}", "w.json"), {"f": "why not"}
    )
    source.carry(source.root.fields["b"].fields["c"], "there")

    made = source.close({}, panels=0, ranks=0)

    assert [(item.what, item.line, item.why) for item in made.carried] == [("b.c", 2, "there")]
    assert [(item.what, item.line) for item in made.not_carried] == [
        ("a = 1", 1),
        ("b.d", 3),
        ("b.d.e = 3", 3),
        ("f", 4),
        ("f.g[0] = 4", 4),
        ("f.g[1] = 5", 4),
    ]
    assert made.not_carried[-1].why == "why not"


def test_a_key_that_stands_twice_is_listed_where_it_does_not_count() -> None:
    source = Source("w.json", json_source.parse("{a: 1,\n a: 2}", "w.json"))
    source.carry(source.root.get("a"))

    made = source.close({}, panels=0, ranks=0)

    assert [(item.what, item.line) for item in made.carried] == [("a", 2)]
    assert [(item.what, item.line) for item in made.not_carried] == [("a = 1", 1)]


def test_values_that_may_be_secrets_are_not_repeated() -> None:
    source = Source("w.json", json_source.parse("{consumerSecret: 'abc'}", "w.json"))

    assert source.close({}, panels=0, ranks=0).not_carried[0].what == "consumerSecret"


@pytest.mark.parametrize("value", [None, True, "x", "", "nan", "inf", 1e10, "1e400", 10**400, float("nan")])
def test_an_unusable_number_is_none(value: str | float | None) -> None:
    assert as_number(value) is None


def test_numbers_may_be_written_as_text() -> None:
    assert as_number(" 2.5 ") == 2.5
