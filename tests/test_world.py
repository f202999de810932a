"""World files: what they say is what is built, and whatever else they say is a clear error."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from mp2a.exceptions import InputError
from mp2a.simulator import World, box, disc, parse_world, read_world

WORLDS = sorted((Path(__file__).parents[1] / "examples" / "worlds").glob("*.toml"))


@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_examples_are_worlds(path):
    world = read_world(path)
    assert world.name
    assert len(world.segments) == len(world.shapes) == 0 or len(world.segments) >= len(world.shapes)


def test_documented_file_has_every_kind():
    page = (WORLDS[0].parents[2] / "docs" / "simulator.md").read_text()
    [text] = re.findall(r"```toml\n(.*?)```", page, flags=re.S)
    world = parse_world(text)
    assert world.name == "a hall"
    assert (len(world.walls), len(world.obstacles)) == (2, 3)


def test_thesis_room_has_its_size():
    world = read_world(next(path for path in WORLDS if path.stem == "thesis"))
    assert_allclose(np.ptp(world.segments.reshape(-1, 2), axis=0), 10.673)


def test_every_kind_of_entry():
    world = parse_world(
        """
        [[room]]
        centre = [1, 2]
        size = [4, 6]
        [[wall]]
        points = [[0, 0], [1, 0], [1.5, 1]]
        [[box]]
        centre = [1, 3]
        size = [2, 1]
        heading = 1.5707963267948966
        [[disc]]
        centre = [2, 2]
        radius = 0.5
        sides = 6
        [[polygon]]
        points = [[0, 0], [1, 0], [0, 1]]
        """,
        "some/place.toml",
    )
    assert world.name == "place"
    assert [len(wall) for wall in world.walls] == [5, 3]
    assert [len(outline) for outline in world.obstacles] == [4, 6, 3]
    assert len(world.segments) == 4 + 2 + 4 + 6 + 3
    areas = [shape.area for shape in world.shapes]
    assert_allclose(areas, [0, 0, 2, 6 * 0.25 * np.tan(np.pi / 6), 0.5])
    assert_allclose(np.ptp(world.obstacles[0], axis=0), (1, 2))
    assert_allclose(world.shapes[3].exterior.distance(world.shapes[3].centroid), 0.5)


@given(st.integers(3, 360), st.floats(0.01, 50))
def test_disc_holds_its_circle(sides, radius):
    corners = disc((3, -1), radius, sides)
    middles = (corners + np.roll(corners, -1, axis=0)) / 2
    assert_allclose(np.linalg.norm(middles - (3, -1), axis=1), radius)


def test_box_turns_counter_clockwise():
    assert_allclose(box((0, 0), (2, 1), np.pi / 2), [[-0.5, 1], [-0.5, -1], [0.5, -1], [0.5, 1]], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[room", "place.toml: cannot be read as TOML"),
        ("x = " + "[" * 100_000, "place.toml: cannot be read as TOML"),
        ("name = 3", "place.toml: name: got 3, expected a text"),
        ("[[house]]", "place.toml: got 'house', expected 'name' or one of 'room', 'wall'"),
        ("[box]\ncentre = [0, 0]", r"place.toml: box: got .*, expected tables, each under \[\[box\]\]"),
        ("box = 3", "place.toml: box: got 3, expected tables"),
        ("[[box]]\nsize = [1, 1]", "place.toml: box 1: centre: got nothing, expected it to be given"),
        ("[[box]]\ncentre = [0, 0]\nsize = [1, -1]", r"box 1: size: got \[1, -1\], expected two lengths"),
        ("[[box]]\ncentre = [0]\nsize = [1, 1]", r"box 1: centre: got \[0\], expected two coordinates"),
        ("[[box]]\ncentre = [0, true]\nsize = [1, 1]", "box 1: centre: got .*, expected two coordinates"),
        ("[[box]]\ncentre = [0, nan]\nsize = [1, 1]", "box 1: centre: got .*, expected two coordinates"),
        ("[[box]]\ncentre = [0, 0]\nsize = [1, 1]\ncolour = 'red'", "box 1: got 'colour', expected one of 'centre'"),
        ("[[disc]]\ncentre = [0, 0]\nradius = inf", "disc 1: radius: got inf, expected a length"),
        ("[[disc]]\ncentre = [0, 0]\nradius = 1\nsides = 9999999999", "disc 1: sides: got 9999999999, expected"),
        (f"[[disc]]\ncentre = [0, 0]\nradius = 1{'0' * 400}", "disc 1: radius: got 1000.*, expected a length"),
        ("[[wall]]\npoints = []", r"wall 1: points: got \[\], expected a list of points"),
        ("[[wall]]\npoints = [[0, 0], [0, 0]]", r"wall 1: got \[0.0, 0.0\] twice in a row"),
        ("[[wall]]\npoints = 'no'", "wall 1: points: got 'no', expected a list of points"),
        ("[[polygon]]\npoints = [[0, 0], [1, 0]]", "polygon 1: got 2 points, expected at least 3"),
        ("[[polygon]]\npoints = [[0, 0], [1, 1], [1, 0], [0, 1]]", "polygon 1: got an outline that crosses"),
        ("[[polygon]]\npoints = [[0, 0], [1, 1], [2, 2]]", "polygon 1: got an outline that crosses or touches"),
    ],
)
def test_mistakes_are_spelled_out(text, message):
    with pytest.raises(InputError, match=message):
        parse_world(text, "place.toml")


def test_files_that_are_none(tmp_path):
    for content in (b"\xff\xfe", b"\x00"):
        (tmp_path / "x.toml").write_bytes(content)
        with pytest.raises(InputError, match=r"x\.toml: cannot be read as"):
            read_world(tmp_path / "x.toml")
    for path in (tmp_path, tmp_path / "missing.toml"):
        with pytest.raises(InputError, match="cannot be read as a world file"):
            read_world(path)


def test_worlds_made_in_python_are_checked():
    with pytest.raises(InputError, match=r"walls\[1\]: got shape"):
        World([[[0, 0], [1, 1]], [[0, 0, 0]]])
    with pytest.raises(InputError, match=r"obstacles\[0\]: got 2e\+06 m"):
        World(obstacles=[[[0, 0], [1, 0], [0, 2e6]]])


values = st.recursive(
    st.one_of(
        st.integers(-(10**6), 10**6).map(str),
        st.floats(-10, 10).map(repr),
        st.sampled_from(["nan", "inf", "-inf", "true", '"text"', "1979-05-27", "1e400", "{}", "0.5", "1", "2", "3"]),
    ),
    lambda inner: st.lists(inner, max_size=4).map(lambda items: f"[{', '.join(items)}]"),
    max_leaves=8,
)
point = st.tuples(st.floats(-20, 20), st.floats(-20, 20)).map(lambda p: f"[{p[0]!r}, {p[1]!r}]")
likely = st.one_of(point, st.lists(point, max_size=6).map(lambda items: f"[{', '.join(items)}]"), values)
fields = st.sampled_from(["centre", "size", "heading", "points", "radius", "sides", "other"])
tables = st.tuples(
    st.sampled_from(["room", "wall", "box", "disc", "polygon", "name", "zebra"]),
    st.sampled_from(["[[{}]]", "[{}]"]),
    st.dictionaries(fields, likely, max_size=4),
).map(lambda t: "\n".join([t[1].format(t[0]), *(f"{k} = {v}" for k, v in t[2].items())]))


@settings(max_examples=400)
@given(st.one_of(st.text(max_size=60), st.lists(tables, max_size=3).map("\n".join)))
def test_any_text_is_a_world_or_a_clear_error(text):
    try:
        world = parse_world(text, "place.toml")
    except InputError as error:
        assert str(error).startswith("place.toml: ")
        assert "expected" in str(error) or "TOML" in str(error)
    else:
        assert np.isfinite(world.segments).all()
        assert (world.segments[:, 0] != world.segments[:, 1]).any(axis=1).all()
