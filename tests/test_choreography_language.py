"""The scenario language: what parses, what does not and where, and that text and data are the same thing."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mp2a.exceptions import DependencyError, InputError
from mp2a.formation.choreography import syntax
from mp2a.formation.choreography.program import CIRCLE, MEET, MOVE, SHAPE, compile_program
from mp2a.formation.choreography.reading import parse, read
from mp2a.formation.choreography.scenario import Circle, Group, Move, NewLeader, Scenario, Shape, format
from mp2a.formation.choreography.syntax import INSTRUCTIONS, grammar
from mp2a.simulator.check import demo

ROOT = Path(__file__).parents[1]
LISTINGS = sorted((ROOT / "examples" / "scenarios").glob("listing_*.txt"))


def mistakes(text):
    return read(text)[1]


def listing(name):
    return (ROOT / "examples" / "scenarios" / f"listing_{name}.txt").read_text()


@pytest.mark.parametrize(
    ("name", "robots", "groups", "instructions"),
    [("6_1", 4, 2, 14), ("6_2", 4, 2, 14), ("6_3", 4, 2, 17), ("7_1", 2, 0, 4), ("7_2", 2, 2, 14), ("7_3", 2, 0, 3),
     ("7_4", 2, 2, 8)],
)  # fmt: skip
def test_listings_of_the_thesis(name, robots, groups, instructions):
    assert mistakes(listing(name)) == []
    scenario = parse(listing(name))
    assert (len(scenario.robots), len(scenario.groups), len(scenario.instructions)) == (robots, groups, instructions)
    assert parse(format(scenario)) == scenario


def test_every_listing_is_looked_at():
    assert len(LISTINGS) == 7


def test_groups_in_either_order_are_the_same_program():
    one, two = (compile_program(parse(listing(name))) for name in ("6_1", "6_2"))
    assert (one.kind == two.kind).all()
    assert (one.values == two.values).all()


def test_comments_blank_lines_and_line_ends_say_nothing():
    text = listing("6_3")
    plain = "\n".join(line for line in text.split("\n") if line and not line.startswith("#"))
    scenario = parse(text)
    assert parse(plain) == scenario
    assert parse("\ufeff" + text.replace("\n", "\r\n")) == scenario
    assert parse(text.replace(" ", "   ").replace("\n", "\n\n# more\n  # and more\n\t\n")) == scenario
    assert parse(text.replace("newVL", "newVl")) == scenario


def test_demo_explains_every_instruction_and_has_no_mistake():
    assert mistakes(demo()) == []
    kinds = {type(instruction) for instruction in parse(demo()).instructions}
    assert kinds == {Shape, Move, Circle, NewLeader}
    comments = "\n".join(line for line in demo().split("\n") if line.startswith("#"))
    for word in ("row", "column", "triangle", "square", "move", "circle", "newVL", "groups", "start", "robots"):
        assert re.search(rf"\b{word}\b", comments)


def test_docs_show_the_grammar_in_use():
    assert grammar() in (ROOT / "docs" / "choreography.md").read_text()


def test_examples_of_the_docs_parse():
    page = (ROOT / "docs" / "choreography.md").read_text()
    head = "\n".join(line.strip() for line in page.split("\n") if line.startswith("    ")).split("start\n")[0]
    head = head[head.index("# First") :] + "start\nsquare R1,R2;R3,R4 2 1;1\nmove 1 0 group1\nmove 1 0 group2\n"
    examples = re.findall(r"^\| `[^`]+` \| `([^`]+)` \|", page, flags=re.M)
    assert {example.split()[0] for example in examples} == {*INSTRUCTIONS}
    for example in examples:
        before = "row R1 0 0\n" if example == "newVL" else ""
        assert mistakes(head + before + example) == []


HEAD = "robots R1 R2 R3 R4\ngroups\ng R1 R2\nh R3 R4\nstart\nsquare R1,R2;R3,R4 2 1;1\nmove 1 0\n"


@pytest.mark.parametrize(
    ("line", "column", "message"),
    [
        ("moev 1 0", 1, "got 'moev', expected row, column"),
        ("  moev,1", 3, "got 'moev', expected robots, groups, start, row"),
        ("move", 5, "got the end of the line, expected a number"),
        ("move 1", 7, "got the end of the line, expected a number"),
        ("move 1 x", 8, "got 'x', expected a number"),
        ("move 1m 0", 6, "got '1m', expected a number"),
        ("move 1 0 g h", 12, "got 'h', expected the end of the line"),
        ("move 1 0 # on", 10, "got a comment, expected it on a line of its own"),
        ("move 1 0 k", 10, "got unknown group 'k', expected g or h"),
        ("move -1 0", 6, "got -1 m, expected more than 0"),
        ("move 1e9 0", 6, "got 1e9, expected at most 10000"),
        ("move 1e999 0", 6, "got 1e999, expected at most 10000"),
        ("circle 1 2", 11, "got the end of the line, expected a number"),
        ("circle 0 90 1", 8, "got a radius of 0"),
        ("circle 2 -90 1", 10, "got angle -90, expected more than 0"),
        ("circle 2 90 0", 13, "got turn rate 0, expected more than 0"),
        ("row R1,R9 0 1", 8, "got unknown robot 'R9', expected R1, R2, R3 or R4"),
        ("row R1,R1 0 1", 8, "got robot R1 twice"),
        ("row R1,R2 0", 12, "got the end of the line, expected"),
        ("row R1;R2 1 0", 1, "row: got rows of 1;1 robots, expected one row"),
        ("row R1,R2 3 1", 11, "got 3 m, expected 0 where there is no gap"),
        ("row R1,R2,R3 0 1,2,3", 16, "got 3 numbers, expected 2 or one for all"),
        ("column R1,R2 0 1", 1, "column: got rows of 2 robots, expected one robot in every row"),
        ("column R1;R2 -1 0", 14, "got -1 m, expected more than 0"),
        ("column R1;R2 1 2", 16, "got 2 m, expected 0 where there is no gap"),
        ("triangle R1,R2;R3 1 1", 1, "triangle: got rows of 2;1 robots"),
        ("triangle R1;R2 1 0", 1, "triangle: got rows of 1;1 robots"),
        ("square R1,R2,R3;R4 1 1", 1, "square: got rows of 3;1 robots"),
        ("square R1,R2;R3,R4 1 1;1;1", 22, "got 3 rows of numbers, expected 2 or one for all"),
        ("row R1 0 0\nrow R1,R2 0 1", 5, "robot R1: in two formations at a time"),
        ("newVL", 1, "newVL: expected it immediately after a formation"),
        ("robots R1", 1, "robots: listed a second time"),
        ("groups", 1, "groups: expected them once"),
        ("start", 1, "start: expected it once"),
        ("new R1", 1, "got 'new', expected row, column"),
    ],
)
def test_a_mistake_is_named_with_its_place(line, column, message):
    text = HEAD + line + "\nmove 1 0 g\nmove 1 0 h\n"
    number = HEAD.count("\n") + line.count("\n") + 1
    assert mistakes(HEAD + "move 1 0 g\nmove 1 0 h\n") == []
    (finding,) = mistakes(text)
    assert finding.serious
    assert (finding.line, finding.column) == (number, column)
    assert message in finding.message
    with pytest.raises(InputError, match=re.escape(f"line {number}, column {column}: {finding.message}")):
        parse(text)


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("", (None, None), "got nothing, expected the list of robots first"),
        ("# nothing\n", (None, None), "got nothing"),
        ("row R1 0 0", (1, 1), "got 'row', expected the list of robots first"),
        ("robots", (1, 7), "got the end of the line, expected a name"),
        ("robots R1 R1\nrow R1 0 0", (1, 11), "robot R1: listed twice"),
        ("robots R1", (None, None), "got no instruction, expected a formation"),
        ("robots R1\nmove 1 0\nrow R1 0 0", (2, 1), "move: no robot has a place yet"),
        ("robots R1 R2\nrow R1 0 0", (1, 11), "robot R2: in no formation"),
        ("robots R1\ngroups\ng R1\nrow R1 0 0\nmove 1 0 g", (4, 1), "got 'row' before start"),
        ("robots R1\nrow R1 0 0\nstart", (3, 1), "start: expected it once, before the first instruction"),
        ("robots R1\ngroups\ng\nstart\nrow R1 0 0\nmove 1 0 g", (3, 1), "group g: got no robot"),
        ("robots R1\ngroups\ng R2\nstart\nrow R1 0 0\nmove 1 0 g", (3, 3), "group g: got unknown robot 'R2'"),
        ("robots R1\ngroups\ng R1\ng R1\nstart\nrow R1 0 0\nmove 1 0 g", (4, 1), "group g: defined twice"),
        ("robots R1 R2\nrow R1 0 0\nmove 1 0\nrow R2 0 0", (3, 1), "move: R2: no place yet"),
    ],
)  # fmt: skip
def test_mistakes_of_the_whole(text, place, message):
    found = mistakes(text)
    assert ((found[0].line, found[0].column), found[0].serious) == (place, True)
    assert message in found[0].message
    with pytest.raises(InputError, match=re.escape(message)):
        parse(text)


def test_more_robots_than_can_be_checked_are_refused():
    names = " ".join(f"R{i}" for i in range(2049))
    (finding,) = mistakes(f"robots {names}\nrow {names.replace(' ', ',')} 0 1\nmove 1 0")
    assert "got 2049, expected at most 2048" in finding.message


def test_what_a_run_survives_is_noted_and_not_refused():
    text = "robots R1\ngroups\na R1\nb R1\nstart\nrow R1 0 0\nmove 0.2 0 a\n"
    notes = mistakes(text)
    assert [(note.line, note.serious) for note in notes] == [(4, False), (4, False), (7, False)]
    for words in ("in groups a and b", "no instruction", "tolerance"):
        assert sum(words in note.message for note in notes) == 1
    assert parse(text).instructions[1] == Move(0.2, 0.0, "a")


def test_every_wrong_line_is_reported():
    wrong = ["move x 0", "circle 1", "square R1 2", "jump", "row R7 0 0", "move 1 0 nobody"]
    text = HEAD + "\n".join(wrong) + "\nmove 1 0 g\nmove 1 0 h"
    assert [finding.line for finding in mistakes(text)] == list(range(8, 8 + len(wrong)))


# ---- text and data ---------------------------------------------------------------------------------------------

NAMES = st.from_regex(r"[^\s;,#][^\s;,]{0,5}", fullmatch=True)
LENGTHS = st.floats(0.01, 100)


@st.composite
def shapes(draw, robots):
    kind = draw(st.sampled_from(["row", "column", "triangle", "square"]))
    n = len(robots)
    if kind == "triangle" and n >= 3:
        rows = (robots[:1], robots[1:])
    elif kind == "square" and n == 4:
        rows = (robots[:2], robots[2:])
    elif kind == "column":
        rows = tuple((robot,) for robot in robots)
    else:
        kind, rows = "row", (robots,)
    distances = tuple(draw(LENGTHS) for _ in rows[1:])
    spacings = tuple(tuple(draw(LENGTHS) for _ in row[1:]) for row in rows)
    return Shape(kind, rows, distances, spacings)


@st.composite
def scenarios(draw):
    robots = tuple(draw(st.lists(NAMES, min_size=1, max_size=5, unique=True)))
    keywords = {"robots", "groups", "start", "row", "column", "triangle", "square", "move", "circle", "newvl"}
    names = draw(st.lists(NAMES.filter(lambda name: name.lower() not in keywords), max_size=2, unique=True))
    groups = tuple(
        Group(name, tuple(draw(st.lists(st.sampled_from(robots), min_size=1, unique=True)))) for name in names
    )
    group = st.sampled_from([None, *names])
    angle, positive = st.floats(-720, 720), st.floats(0.001, 100)
    moves = st.one_of(
        st.builds(Move, positive, angle, group),
        st.builds(Circle, st.floats(-50, 50).filter(bool), positive, positive, group),
    )
    out = [draw(shapes(robots))]
    for _ in range(draw(st.integers(0, 4))):
        out += draw(st.lists(moves, min_size=1, max_size=3))
        order = tuple(draw(st.permutations(robots)))
        out.append(draw(shapes(order)))
        out += [NewLeader()] * draw(st.integers(0, 1))
    return Scenario(robots, groups, tuple(out))


@given(scenarios())
@settings(max_examples=150, deadline=None)
def test_text_and_data_are_the_same_thing(scenario):
    assert parse(format(scenario)) == scenario
    assert not any(finding.serious for finding in mistakes(format(scenario)))


@given(scenarios())
@settings(max_examples=50, deadline=None)
def test_every_robot_gets_every_instruction_that_is_for_it(scenario):
    program = compile_program(scenario)
    kinds = {Shape: (SHAPE, MEET), Move: (MOVE,), Circle: (CIRCLE,)}
    for i, robot in enumerate(scenario.robots):
        mine = [
            x for x in scenario.instructions
            if (isinstance(x, Shape) and robot in x.robots)
            or (isinstance(x, Move | Circle) and robot in scenario.members(x.group))
        ]  # fmt: skip
        assert len(mine) == (program.instruction[i] >= 0).sum()
        for x, kind, number in zip(mine, program.kind[i], program.instruction[i], strict=False):
            assert kind in kinds[type(x)]
            assert scenario.instructions[number] == x


@given(st.data())
@settings(max_examples=50, deadline=None)
def test_places_are_as_far_apart_as_written(data):
    shape = data.draw(shapes(("a", "b", "c", "d")))
    where = shape.slots()
    assert set(where) == set(shape.robots)
    x = [where[row[0]][0] for row in shape.rows]
    assert x[0] == -0.5
    np.testing.assert_allclose(-np.diff(x), shape.distances, atol=1e-9)
    for row, gaps in zip(shape.rows, shape.spacings, strict=True):
        spots = np.array([where[robot] for robot in row])
        assert (spots[:, 0] == spots[0, 0]).all()
        np.testing.assert_allclose(-np.diff(spots[:, 1]), gaps, atol=1e-9)
        assert abs(spots[0, 1] + spots[-1, 1]) < 1e-9


# ---- anything --------------------------------------------------------------------------------------------------

WORDS = ["robots", "groups", "start", "row", "move", "circle", "newVL", "R1", "R2", "g", "1", "-90", "0", ";", ",", "#",
         "\n", " ", "\x00", "1e999", "nan", "é"]  # fmt: skip


@given(st.one_of(st.text(max_size=200), st.lists(st.sampled_from(WORDS), max_size=40).map(" ".join)))
@settings(max_examples=300, deadline=None)
def test_any_text_is_a_scenario_or_a_clear_error(text):
    found = mistakes(text)
    try:
        scenario = parse(text)
    except InputError as error:
        assert str(error)
        assert any(finding.serious for finding in found)
    else:
        assert not any(finding.serious for finding in found)
        assert parse(format(scenario)) == scenario


def test_a_missing_parser_is_named_with_the_extra_that_has_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "lark", None)
    syntax._parser.cache_clear()
    with pytest.raises(DependencyError, match=r"reading a scenario needs lark, .*pip install 'mp2a\[formation\]'"):
        parse("robots R1\nrow R1 0 0\nmove 1 0")
