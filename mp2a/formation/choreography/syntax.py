"""From text to lines of words, by the grammar next door; the only part that loads the parser library."""

import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from mp2a.dependencies import need
from mp2a.formation.choreography.findings import Finding

if TYPE_CHECKING:
    from lark import Lark, Token, Tree
    from lark.exceptions import UnexpectedInput

INSTRUCTIONS = ("row", "column", "triangle", "square", "move", "circle", "newVL")
_KEYWORDS = ("robots", "groups", "start", *INSTRUCTIONS)
_WORDS = {
    "NAME": "a name",
    "NUMBER": "a number",
    "SEMICOLON": "';'",
    "COMMA": "','",
    "$END": "the end of the line",
    "<END-OF-FILE>": "the end of the line",
}


class Word(NamedTuple):
    """A word of the text and where it stands."""

    text: str
    line: int
    column: int


class ScenarioLine(NamedTuple):
    """A line that fits the grammar."""

    kind: str
    """Name of the grammar's rule: robots, groups, group, start, formation, move, circle, new_leader."""
    keyword: Word
    """What it begins with: of a group its name, of a formation its shape."""
    words: tuple[Word, ...]
    """What follows, apart from the parts."""
    parts: tuple[tuple[tuple[Word, ...], ...], ...]
    """Of a formation: robots, distances and spacings, each row by row."""


def lines(text: str) -> Iterator[ScenarioLine | Finding]:
    """Lines that say something, each as words or as what is wrong with it."""
    for number, content in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        stripped = content.strip()
        if stripped and not stripped.startswith("#"):
            yield _line(number, content)


def grammar() -> str:
    """Text of the grammar."""
    return Path(__file__).with_name("grammar.lark").read_text(encoding="utf-8")


@cache
def _parser() -> "Lark":
    lark = need("lark", extra="formation", purpose="reading a scenario")
    parser: Lark = lark.Lark(grammar(), start="line", parser="lalr", maybe_placeholders=False)
    return parser


def _line(number: int, content: str) -> ScenarioLine | Finding:
    parser = _parser()
    from lark.exceptions import UnexpectedInput

    try:
        tree = parser.parse(content)
    except UnexpectedInput as error:
        return _wrong(number, content, error)
    kind, words = str(tree.data), _words(tree, number)
    if kind in ("formation", "group"):
        keyword, *words = words
    else:
        keyword = Word("newVL" if kind == "new_leader" else kind, number, 1)
    parts = (part for part in tree.children if not isinstance(part, str))
    rows = (tuple(tuple(_words(row, number)) for row in part.children if not isinstance(row, str)) for part in parts)
    return ScenarioLine(kind, keyword, tuple(words), tuple(rows))


def _words(tree: "Tree[Token]", number: int) -> list[Word]:
    return [Word(str(word), number, word.column or 1) for word in tree.children if isinstance(word, str)]


def _wrong(number: int, content: str, error: "UnexpectedInput") -> Finding:
    """Say what stands where something else was expected."""
    first = re.split(r"[\s;,]", content.strip(), maxsplit=1)[0]
    if first.lower() not in {word.lower() for word in _KEYWORDS}:
        column = len(content) - len(content.lstrip()) + 1
        return Finding("syntax", f"got {first[:40]!r}, expected {one_of(_KEYWORDS)}", line=number, column=column)
    end = len(content.rstrip()) + 1
    column = min(error.column, end) if error.column > 0 else end
    token = getattr(error, "token", None)
    at_end = token is not None and token.type == "$END"
    if at_end:
        column = end
    rest = content[column - 1 :]
    if rest.startswith("#"):
        return Finding("syntax", "got a comment, expected it on a line of its own", line=number, column=column)
    word = re.match(r"[;,]|[^\s;,]+", rest)
    got = "the end of the line" if at_end or word is None else repr(word[0][:40])
    terminals = getattr(error, "accepts", None) or getattr(error, "allowed", None) or getattr(error, "expected", ())
    expected = one_of(sorted(_WORDS.get(name, name.lower()) for name in terminals or ()))
    return Finding("syntax", f"got {got}, expected {expected}", line=number, column=column)


def one_of(words: Iterable[str], last: str = "or", most: int = 20) -> str:
    """Words with an "or" before the last, as long as there are not too many."""
    *before, end = words
    if len(before) >= most:
        return ", ".join(before[:most]) + ", …"
    return f"{', '.join(before)} {last} {end}" if before else end
