"""A chain checks what it is given, does not change, and survives being saved."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from helpers import ALL_JOINTS, random_forest
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
from mp2a import InputError, Model
from mp2a.exceptions import OutputError
from mp2a.joints import JOINTS

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 12)


@st.composite
def models(draw):
    """Random chains and trees of all joint types."""
    return random_forest(draw(sizes), draw(seeds), branching=draw(st.integers(1, 4)))


def changed(array, where, value):
    out = np.array(array, dtype=float)
    out[where] = value
    return out


FIVE = Model.random(5, seed=1, joints=("revolute", "prismatic"))
WRONG = [
    ("parents", [], "no body", "at least one"),
    ("parents", [-1, 0, 2, 1, 3], "2 for body 2", "earlier body"),
    ("parents", [-1, 0, -2, 1, 3], "-2 for body 2", "-1 or an earlier body"),
    ("parents", [-1, 0, 0.5, 1, 3], "0.5", "whole numbers"),
    ("parents", [[-1, 0, 1, 2, 3]], "(1, 5)", "(n,)"),
    ("joints", ("revolute", "hinge", *FIVE.joints[2:]), "'hinge' for body 1", "revolute, continuous, prismatic"),
    ("joints", ("revolute",) * 4, "got 4", "5, one a body"),
    ("axes", FIVE.axes[:, :2], "(5, 2)", "(5, 3)"),
    ("axes", changed(FIVE.axes, 3, 0.0), "zero axis for body 3", "a direction"),
    ("axes", changed(FIVE.axes, (3, 1), np.nan), "nan at (3, 1)", "finite"),
    ("rotations", FIVE.rotations[0], "(3, 3)", "(5, 3, 3)"),
    ("rotations", changed(FIVE.rotations, 2, -np.eye(3)), "2.0e+00 away from one for body 2", "a rotation"),
    ("rotations", changed(FIVE.rotations, 4, 1.1 * np.eye(3)), "for body 4", "a rotation"),
    ("translations", "here", "got str", "numbers"),
    ("translations", changed(FIVE.translations, (0, 2), np.inf), "inf at (0, 2)", "finite"),
    ("masses", FIVE.masses[:4], "(4,)", "(5,)"),
    ("masses", changed(FIVE.masses, 3, -1.0), "-1.0 for body 3", "no negative mass"),
    ("coms", np.zeros((5, 4)), "(5, 4)", "(5, 3)"),
    ("inertias", np.zeros((5, 3)), "(5, 3)", "(5, 3, 3)"),
    ("inertias", changed(FIVE.inertias, (1, 0, 2), 1.0), "unsymmetric one for body 1", "symmetric"),
    ("inertias", changed(FIVE.inertias, 2, -np.eye(3)), "moment of -1 kg m² for body 2", "none below 0"),
    ("inertias", changed(FIVE.inertias, 4, np.diag([1, 1, -1e-6])), "for body 4", "none below 0"),
    ("coms", changed(FIVE.coms, 1, 1e200), "[1e+200, 1e+200, 1e+200] for body 1", "finite inertia"),
    ("names", ("a", "b"), "got 2", "5, one a body"),
    ("gravity", [0, -9.81], "(2,)", "(3,)"),
    ("gravity", [0, 0, np.inf], "inf at (2,)", "finite"),
]


@pytest.mark.parametrize(("field", "value", "got", "expected"), WRONG)
def test_error_names_the_argument_what_was_given_and_what_was_expected(field, value, got, expected):
    with pytest.raises(InputError) as error:
        dataclasses.replace(FIVE, **{field: value})
    text = str(error.value)
    assert text.startswith(f"{field}: got ")
    before, after = text.split("expected")
    assert got in before
    assert expected in after


def test_unsymmetric_inertia_is_found_where_it_is():
    """Beside a body so heavy that its rounding is larger than the mistake."""
    inertias = changed(FIVE.inertias, 0, 1e12 * np.eye(3))
    inertias[0, 0, 1], inertias[3, 0, 1] = 1e-2, inertias[3, 0, 1] + 1e-3
    with pytest.raises(InputError, match="body 3"):
        dataclasses.replace(FIVE, inertias=inertias)


def test_axes_get_unit_length():
    stretched = dataclasses.replace(FIVE, axes=5.0 * FIVE.axes)
    assert np.allclose(stretched.axes, FIVE.axes, rtol=0, atol=1e-15)


@pytest.mark.parametrize("size", [1e200, 1e-200, 5e-324, 1.7e308])
def test_axes_of_any_length_get_unit_length(size):
    model = Model.uniform(3, axis=(size, 0, size))
    assert np.allclose(model.axes, [np.sqrt(0.5), 0, np.sqrt(0.5)], rtol=0, atol=1e-15)
    assert dataclasses.replace(model) == model


def test_moments_that_only_rounding_makes_negative_are_let_through():
    rod = np.diag([0.0, 1.0, 1.0])
    turn = Model.random(1).rotations[0]
    assert len(Model.uniform(2, inertia=turn @ rod @ turn.T)) == 2
    assert len(Model.uniform(2, inertia=np.diag([1.0, 1.0, 3.0]))) == 2  # no real body, but solvable


@given(model=models())
def test_copies_are_equal_and_cannot_be_written(model):
    state = model.random_state()
    torque = mp2a.rnea(model, *state)  # makes what a model keeps
    for twin in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model), copy.copy(model), dataclasses.replace(model)):
        assert twin == model
        assert np.array_equal(mp2a.rnea(twin, *state), torque)
        arrays = [getattr(twin, field.name) for field in dataclasses.fields(Model)]
        arrays += [twin.q_starts, twin.v_starts, twin.origin_inertias, twin.neutral]
        arrays += [array for group in twin.groups for array in group[1:]]
        for array in arrays:
            assert not isinstance(array, np.ndarray) or not array.flags.writeable


@given(model=models(), data=st.data())
def test_block_is_those_bodies_alone(model, data):
    start = data.draw(st.integers(0, len(model) - 1))
    stop = data.draw(st.integers(start + 1, len(model)))
    if (model.parents[start + 1 : stop] == np.arange(start, stop - 1)).all():
        block = model.block(range(start, stop))
        assert block.is_serial
        assert (block.names, block.joints) == (model.names[start:stop], model.joints[start:stop])
        assert np.array_equal(block.translations, model.translations[start:stop])
    else:
        with pytest.raises(InputError, match=r"bodies: got .*branch"):
            model.block(range(start, stop))
    for wrong in (range(0), range(len(model) + 1), range(-1, 1), range(len(model), 0, -1), range(0, len(model), 2)):
        if wrong != range(1):
            with pytest.raises(InputError, match="bodies: got"):
                model.block(wrong)


def test_interrupted_save_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "model.npz"
    FIVE.save(path)

    def half(file, **arrays):
        file.write(b"half of")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", half)
    with pytest.raises(KeyboardInterrupt):
        Model.uniform(3).save(path)
    monkeypatch.undo()
    assert Model.load(path) == FIVE
    assert [file.name for file in tmp_path.iterdir()] == ["model.npz"]
    with pytest.raises(OutputError, match=r"model\.npz"):
        FIVE.save(path / "model.npz")


@given(model=models())
def test_save_and_load_keep_every_bit(tmp_path, model):
    model.save(tmp_path / "chain.npz")
    loaded = Model.load(tmp_path / "chain.npz")
    assert loaded == model
    for field in dataclasses.fields(Model):
        assert np.array_equal(getattr(loaded, field.name), getattr(model, field.name))


def test_names_survive_a_file(tmp_path):
    named = dataclasses.replace(FIVE, names=("σκέλος", "", "a b", "x" * 300, "5"))
    named.save(tmp_path / "chain.npz")
    assert Model.load(str(tmp_path / "chain.npz")).names == named.names


@given(data=st.data())
@settings(max_examples=300)
def test_damaged_file_gives_an_input_error_or_the_chain(tmp_path, data):
    path = tmp_path / "damaged.npz"
    FIVE.save(path)
    content = bytearray(path.read_bytes())
    start = data.draw(st.integers(0, len(content) - 1))
    content[start : start + data.draw(st.integers(0, 40))] = data.draw(st.binary(max_size=40))
    path.write_bytes(content)
    try:
        loaded = Model.load(path)
    except InputError as error:
        assert str(path) in str(error)
    else:
        assert loaded == FIVE


@given(content=st.binary(max_size=200))
def test_any_other_file_gives_an_input_error(tmp_path, content):
    path = tmp_path / "other.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match="cannot be read as a model"):
        Model.load(path)


ODD_VALUES = (
    np.zeros(4), np.array("word"), np.array([["revolute"]]), np.array(99), np.zeros((2, 2), dtype=complex),
    np.array([b"bytes"]), np.zeros(1, dtype=[("a", "f8")]), np.array([np.nan]), np.array(["2020"], dtype="datetime64"),
)  # fmt: skip


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@pytest.mark.parametrize("key", ["format", *(field.name for field in dataclasses.fields(Model))])
def test_file_with_a_wrong_array_gives_an_input_error(tmp_path, key):
    FIVE.save(tmp_path / "chain.npz")
    with np.load(tmp_path / "chain.npz") as file:
        arrays = dict(file)
    for value in ODD_VALUES:
        np.savez(tmp_path / "wrong.npz", **{**arrays, key: value})
        with pytest.raises(InputError):
            Model.load(tmp_path / "wrong.npz")
    del arrays[key]
    np.savez(tmp_path / "missing.npz", **arrays)
    with pytest.raises(InputError, match="expected a model of format"):
        Model.load(tmp_path / "missing.npz")


def test_what_is_no_chain_file_gives_an_input_error(tmp_path):
    np.save(tmp_path / "array.npy", np.zeros(3))
    for path in (tmp_path / "array.npy", tmp_path / "missing.npz", tmp_path):
        with pytest.raises(InputError, match="path: "):
            Model.load(path)


@given(n=sizes, seed=seeds)
def test_digest_is_equal_exactly_for_equal_chains(n, seed):
    model = Model.random(n, seed, ALL_JOINTS)
    same = Model.random(n, seed, ALL_JOINTS)
    assert (model == same, model.digest() == same.digest(), hash(model) == hash(same)) == (True, True, True)
    body = seed % n
    for field in ("translations", "masses", "coms", "inertias", "gravity"):
        value = getattr(model, field).copy()
        value[body % len(value)] = np.nextafter(value[body % len(value)], np.inf)
        assert dataclasses.replace(model, **{field: value}) != model
    assert dataclasses.replace(model, names=("other", *model.names[1:])) != model


def test_digest_knows_joints_parents_and_zeros():
    model = Model.uniform(3)
    assert dataclasses.replace(model, joints=("revolute", "continuous", "revolute")) != model
    assert dataclasses.replace(model, parents=[-1, 0, 0]) != model
    assert dataclasses.replace(model, translations=-0.0 * model.translations) == dataclasses.replace(
        model, translations=0.0 * model.translations
    )
    assert model != "chain"


@given(model=models())
def test_body_is_that_body_alone(model):
    for i in range(len(model)):
        body = model.body(i)
        assert len(body) == 1
        assert body.parents[0] == -1
        for name in ("joints", "axes", "rotations", "translations", "masses", "coms", "inertias", "names"):
            assert np.array_equal(getattr(body, name)[0], getattr(model, name)[i])
        assert np.array_equal(body.gravity, model.gravity)
    for i in (-1, len(model)):
        with pytest.raises(InputError, match=f"i: got {i}"):
            model.body(i)


@given(model=models(), samples=st.one_of(st.none(), st.integers(0, 3)), seed=seeds)
def test_one_bodys_random_state_is_its_part_of_the_whole(model, samples, seed):
    q, v, a = model.random_state(samples, seed)
    lead = () if samples is None else (samples,)
    assert (q.shape, v.shape, a.shape) == ((*lead, model.nq), (*lead, model.nv), (*lead, model.nv))
    for i in range(len(model)):
        own = model.random_state(samples, seed, body=i)
        coordinates = slice(model.q_starts[i], model.q_starts[i + 1])
        rates = slice(model.v_starts[i], model.v_starts[i + 1])
        assert np.array_equal(own[0], q[..., coordinates])
        assert np.array_equal(own[1], v[..., rates])
        assert np.array_equal(own[2], a[..., rates])
        unit = JOINTS[model.joints[i]].unit
        if unit is not None:
            assert np.allclose(np.linalg.norm(own[0][..., unit], axis=-1), 1.0, rtol=0, atol=1e-15)


@given(model=models())
def test_groups_cover_every_body_and_column_once(model):
    for name, count in (("bodies", len(model)), ("q_columns", model.nq), ("v_columns", model.nv)):
        covered = np.concatenate([getattr(group, name).ravel() for group in model.groups])
        assert sorted(covered) == list(range(count))
    for group in model.groups:
        assert {model.joints[i] for i in group.bodies} == {group.joint.name}


def test_serial_chains_and_trees_are_told_apart():
    tree = dataclasses.replace(FIVE, parents=[-1, 0, 0, 2, 2])
    two_roots = dataclasses.replace(FIVE, parents=[-1, 0, -1, 2, 3])
    assert FIVE.is_serial
    assert not tree.is_serial
    assert not two_roots.is_serial
    assert repr(tree).startswith("<Model of 5 bodies (tree; ")
    assert repr(Model.uniform(2, joint="free")) == "<Model of 2 bodies (chain; 2 free), nq=14, nv=12>"


@pytest.mark.parametrize("field", [field.name for field in dataclasses.fields(Model)])
def test_fields_cannot_be_set(field):
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(FIVE, field, getattr(FIVE, field))


@pytest.mark.parametrize(
    "name",
    [
        "parents",
        "axes",
        "rotations",
        "translations",
        "masses",
        "coms",
        "inertias",
        "gravity",
        "neutral",
        "q_starts",
        "v_starts",
        "origin_inertias",
    ],
)
def test_arrays_cannot_be_written(name):
    with pytest.raises(ValueError, match="read-only"):
        getattr(FIVE, name)[0] = 0


def test_chain_keeps_nothing_of_the_callers_arrays():
    fields = {field.name: np.array(getattr(FIVE, field.name)) for field in dataclasses.fields(Model)}
    model = Model(**fields)
    for name in ("parents", "axes", "rotations", "translations", "masses", "coms", "inertias", "gravity"):
        fields[name][:] = 0
    assert model == FIVE
