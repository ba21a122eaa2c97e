"""Parse an Equalizer configuration to a tree of statements, each with its position and the report on it.

A statement is a word followed by values or by a block of statements, as the rules of language.py say for the block
that it stands in. What follows a word depends on that block, and refusals name what it wanted, so this is a
recursive-descent parser with one token of lookahead.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NoReturn

from wall.core.errors import ConfigError
from wall.importers.equalizer.language import ALIASES, BLOCKS, COUNTED_SETTINGS, OPEN_BLOCKS, SETTINGS, SWITCHES, Rule
from wall.importers.report import NotThisFormat
from wall.importers.source import LARGEST, LONGEST_SHOWN

Value = str | float | int
MAX_DEPTH = 200  # nested blocks; deeper files fill the stack
MAX_DIGITS = 40  # characters of a number


_TOKEN = re.compile(
    r"""(?P<space>[\s,;]+|//[^\n]*|\#[^\n]*)
    |(?P<string>"[^"\n]*")
    |(?P<character>'[^\n]')
    |(?P<number>[+-]?(?:\d+\.\d*|\.\d+|\d+)(?:[eE][+-]?\d+)?(?![\w.]))
    |(?P<word>2D\b|[A-Za-z_]\w*)
    |(?P<sign>[{}\[\]()])""",
    re.VERBOSE,
)


@dataclass(frozen=True, slots=True)
class Token:
    """A token and the position where it begins, from 1."""

    kind: str  # string, character, number, word, sign, end
    text: str
    line: int
    column: int

    @property
    def shown(self) -> str:
        """The token as refusals show it."""
        return "the end of the file" if self.kind == "end" else self.text[:60]


@dataclass(slots=True, eq=False)
class Statement:
    """A word, what follows it, and the report on it."""

    word: str
    line: int
    column: int
    parent: Statement | None = None
    values: list[Value] = field(default_factory=list)
    body: list[Statement] | None = None
    known: bool = True  # whether the language names this word here
    carried: bool | None = None  # None: not reported yet
    why: str = ""

    def carry(self, why: str = "") -> None:
        """Report it as carried; `why` says as what."""
        self.carried, self.why = True, why or self.why

    def drop(self, why: str) -> None:
        """Report it as not carried, and why."""
        self.carried, self.why = False, why

    def all(self, *words: str) -> list[Statement]:
        """Statements of its block with one of these words, in order."""
        return [one for one in self.body or () if one.word in words]

    def last(self, word: str) -> Statement | None:
        """The last statement of its block with this word, which overrules earlier ones."""
        found = self.all(word)
        for overruled in found[:-1]:
            overruled.drop(f"line {found[-1].line} says it again")
        return found[-1] if found else None

    def text(self, word: str) -> str:
        """The text after a word of its block, reported as carried; empty if the word is missing."""
        found = self.last(word)
        if found is None:
            return ""
        found.carry()
        return str(found.values[0])

    def numbers(self, word: str) -> list[float] | None:
        """The numbers after a word of its block, reported as carried; None if the word is missing."""
        found = self.last(word)
        if found is None:
            return None
        found.carry()
        return [float(value) for value in found.values]

    def walk(self) -> Iterator[Statement]:
        """The statement and all inside it, in the order of the text."""
        yield self
        for one in self.body or ():
            yield from one.walk()


def parse(text: str, name: str) -> Statement:
    """The whole file as one block. Raises NotThisFormat if it does not begin as one, ConfigError for a mistake."""
    return _Parser(text.removeprefix("\ufeff"), name).file()


def shown_values(statement: Statement) -> str:
    """The values as the source writes them, shortened."""
    text = " ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in statement.values)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def _may_be(word: str, parent: Statement) -> bool:
    """Whether a word may be an attribute of another version of the language."""
    return word.startswith("EQ_") == (parent.word == "global")


class _Parser:
    """A recursive-descent parser: one token of lookahead, a method for each form of rule."""

    def __init__(self, text: str, name: str) -> None:
        self._name, self._text = name, text
        self._tokens = self._read()
        try:
            self._next = next(self._tokens)
        except ConfigError as error:
            raise NotThisFormat(str(error)) from None
        self._depth = 0

    def file(self) -> Statement:
        """The whole file. Raises NotThisFormat or ConfigError."""
        top = Statement(word="file", line=1, column=1, body=[])
        if self._next.text not in BLOCKS["file"]:
            token = self._next
            raise NotThisFormat(
                f"{self._name}:{token.line}:{token.column}: {token.shown!r} begins no Equalizer configuration; "
                "wanted: server, config or global"
            )
        while self._next.kind != "end":
            self._statement(top, BLOCKS["file"], open_block=False)
        if not any(one.word in ("server", "config") for one in top.body or ()):
            self._refuse("no server and no config in the file", "server { config { ... } }")
        return top

    def _read(self) -> Iterator[Token]:
        """Tokens without blanks and comments, then the end again and again."""
        line, start, at = 1, 0, 0
        while at < len(self._text):
            match = _TOKEN.match(self._text, at)
            column = at - start + 1
            if match is None:
                self._refuse_at(line, column, self._text[at : at + 20].split("\n")[0], "a word, a number or a text")
            if match.lastgroup != "space":
                yield Token(str(match.lastgroup), match.group(), line, column)
            if newlines := match.group().count("\n"):
                line, start = line + newlines, at + match.group().rfind("\n") + 1
            at = match.end()
        while True:
            yield Token("end", "", line, at - start + 1)

    def _refuse_at(self, line: int, column: int, came: str, wanted: str) -> NoReturn:
        raise ConfigError(f"{self._name}:{line}:{column}: {came!r} came; wanted: {wanted}")

    def _refuse(self, came: str, wanted: str) -> NoReturn:
        raise ConfigError(f"{self._name}:{self._next.line}:{self._next.column}: {came}; wanted: {wanted}")

    def _take(self) -> Token:
        token, self._next = self._next, next(self._tokens)
        return token

    def _expect(self, kind: str, wanted: str, *, text: str = "") -> Token:
        if self._next.kind != kind or (text and self._next.text != text):
            self._refuse(f"{self._next.shown!r} came", wanted)
        return self._take()

    def _statement(self, parent: Statement, rules: Mapping[str, Rule], *, open_block: bool) -> None:
        """Read one statement; words that `rules` do not name are read only in an open block."""
        token = self._next
        word = ALIASES.get(token.text, token.text)
        rule = rules.get(word) if token.kind == "word" else None
        if rule is None and not (open_block and token.kind == "word" and _may_be(token.text, parent)):
            near = difflib.get_close_matches(token.text, rules, n=1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            inside = f" in {parent.word} of line {parent.line}" if parent.word != "file" else ""
            self._refuse(f"{token.shown!r} came{inside}", ", ".join(sorted(rules) or ["nothing"]) + " or }" + hint)
        self._take()
        statement = Statement(word=word, line=token.line, column=token.column, parent=parent)
        assert parent.body is not None
        parent.body.append(statement)
        if rule is None:
            statement.known = parent.word == "global"
            self._any_value(statement)
        else:
            self._after(statement, rule)

    def _after(self, statement: Statement, rule: Rule) -> None:
        """Read what a rule wants after a word."""
        wanted = f"{rule.wanted} after {statement.word}"
        if rule.form == "block":
            self._block(statement, rule.block, "{", "}")
        elif rule.form in ("string", "character"):
            statement.values.append(self._expect(rule.form, wanted).text[1:-1])
        elif rule.form in ("number", "whole"):
            statement.values.append(self._number(wanted, whole=rule.form == "whole"))
        elif rule.form in ("numbers", "wholes"):
            self._expect("sign", wanted, text="[")
            for _ in range(rule.count):
                statement.values.append(self._number(wanted, whole=rule.form == "wholes"))
            self._expect("sign", f"] after {rule.count} numbers of {statement.word}", text="]")
        elif rule.form == "words":
            self._expect("sign", wanted, text="[")
            while self._next.text != "]":
                statement.values.append(self._word(rule.words, wanted))
            self._take()
        elif rule.form in ("word", "connection"):
            statement.values.append(self._word(rule.words, wanted))
        elif rule.form == "setting":
            self._setting(statement, wanted)
        else:
            self._choice(statement, rule, wanted)

    def _choice(self, statement: Statement, rule: Rule, wanted: str) -> None:
        """Read what follows a word whose rule allows several forms."""
        if rule.form == "bound" and self._next.text == "[":
            self._after(statement, Rule("wholes", count=2))
        elif rule.form == "bound":
            statement.values.append(self._number(wanted))
        elif rule.form == "channel" and self._next.text == "(":
            self._block(statement, rule.block, "(", ")")
        elif self._next.kind == "string":
            statement.values.append(self._take().text[1:-1])
        elif self._next.text in rule.words:
            statement.values.append(self._take().text)
        elif rule.form == "reference":
            statement.values.append(self._number(wanted, whole=True))
        else:
            self._refuse(f"{self._next.shown!r} came", wanted)

    def _block(self, statement: Statement, name: str, begin: str, end: str) -> None:
        """Read the statements of a block between its brackets."""
        self._expect("sign", f"{begin} after {statement.word}", text=begin)
        self._depth += 1
        if self._depth > MAX_DEPTH:
            self._refuse(f"blocks are nested {self._depth} deep", f"at most {MAX_DEPTH}")
        statement.body = []
        while self._next.text != end or self._next.kind != "sign":
            if self._next.kind == "end":
                self._refuse(f"the file ends in {statement.word}, begun on line {statement.line}", end)
            self._statement(statement, BLOCKS[name], open_block=name in OPEN_BLOCKS)
        self._take()
        self._depth -= 1

    def _number(self, wanted: str, *, whole: bool = False) -> float | int:
        """Take a number up to LARGEST, a whole one without a minus if `whole`."""
        token = self._next
        if token.kind != "number":
            self._refuse(f"{token.shown!r} came", wanted)
        if len(token.text) > MAX_DIGITS:
            self._refuse(f"{token.text[:20]}... has too many digits", wanted)
        if whole and not re.fullmatch(r"\+?\d{1,9}", token.text):
            self._refuse(f"{token.shown!r} came", wanted)
        value = int(token.text) if whole else float(token.text)
        if abs(value) > LARGEST:
            self._refuse(f"{token.shown} is too large", "a number up to 1e9")
        self._take()
        return value

    def _word(self, words: tuple[str, ...], wanted: str) -> str:
        """Take one of these words."""
        if self._next.kind != "word" or self._next.text not in words:
            self._refuse(f"{self._next.shown!r} came", wanted)
        return self._take().text

    def _setting(self, statement: Statement, wanted: str) -> None:
        """Read a setting: a number, a word with a number, a switch, or another of the known words."""
        if self._next.kind == "number":
            statement.values.append(self._number(wanted))
        elif self._next.text in COUNTED_SETTINGS:
            statement.values.extend((self._take().text, self._number(wanted)))
        elif self._next.text in SWITCHES:
            statement.values.append(self._take().text.upper())
        else:
            statement.values.append(self._word(SETTINGS, wanted))

    def _any_value(self, statement: Statement) -> None:
        """Read the value of an attribute that this version of the language does not name."""
        if self._next.text == "{":
            self._block(statement, "attributes", "{", "}")
        elif self._next.text == "[":
            self._take()
            while self._next.kind in ("word", "number", "string"):
                statement.values.append(self._take().text)
            self._expect("sign", f"] after {statement.word}", text="]")
        elif self._next.kind in ("string", "character"):
            statement.values.append(self._take().text[1:-1])
        elif self._next.text in COUNTED_SETTINGS:
            self._setting(statement, "a number")
        elif self._next.kind in ("number", "word"):
            statement.values.append(self._take().text)
        else:
            self._refuse(f"{self._next.shown!r} came", f"a value after {statement.word}")
