"""Chains from parameters, Denavit-Hartenberg rows, pinocchio and URDF are the mechanisms they describe."""

import dataclasses
import re

import numpy as np
import pinocchio
import pytest
from helpers import ALL_JOINTS, placements, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
from mp2a import InputError, Model

seeds = st.integers(0, 2**32 - 1)


# ---- made up -------------------------------------------------------------------------------------------------------


def test_uniform_bodies_are_equal_and_one_offset_apart():
    model = Model.uniform(6, joint="prismatic", axis=(0, 3, 4), offset=(0.5, 0, 1), mass=2.5)
    assert set(model.joints) == {"prismatic"}
    assert np.allclose(model.axes, [0, 0.6, 0.8])
    _, origins = placements(model, model.neutral)
    assert np.allclose(origins, np.outer(range(6), (0.5, 0, 1)))
    for i in range(2, 6):
        assert dataclasses.replace(model.body(i), names=("x",)) == dataclasses.replace(model.body(1), names=("x",))
    assert Model.uniform(2, inertia=3 * np.eye(3)).inertias[1, 0, 0] == 3.0


@given(n=st.integers(1, 30), seed=seeds, branching=st.integers(1, 5))
def test_random_bodies_are_possible_bodies(n, seed, branching):
    model = Model.random(n, seed, ALL_JOINTS, branching)
    moments = np.linalg.eigvalsh(model.inertias)
    assert (moments > 0).all()
    assert (moments[:, 0] + moments[:, 1] >= moments[:, 2]).all()  # else no distribution of mass has this inertia
    back = np.arange(n) - model.parents
    assert (back >= 1).all()
    assert (back[1:] <= branching).all()
    assert model.is_serial or branching > 1


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: Model.uniform(0), "n"),
        (lambda: Model.uniform(2.5), "n"),
        (lambda: Model.uniform(2, offset=(1, 0)), "offset"),
        (lambda: Model.uniform(2, joint="hinge"), "joints"),
        (lambda: Model.uniform(2, axis=(0, 0, 0)), "axes"),
        (lambda: Model.uniform(2, mass=-1), "masses"),
        (lambda: Model.random(-1), "n"),
        (lambda: Model.random(2, joints=()), "joints"),
        (lambda: Model.random(2, joints=("hinge",)), "joints"),
        (lambda: Model.random(2, branching=0), "branching"),
        (lambda: Model.from_dh([[1, 2, 3]]), "rows"),
        (lambda: Model.from_dh(np.zeros((0, 4))), "rows"),
        (lambda: Model.from_dh([[0, np.nan, 0, 0]]), "rows"),
        (lambda: Model.from_dh([[0, 0, 0, 0]], convention="classic"), "convention"),
        (lambda: Model.from_dh([[0, 0, 0, 0]], joints=["spherical"]), "joints"),
        (lambda: Model.from_dh([[0, 0, 0, 0]], joints=["revolute"] * 2), "joints"),
        (lambda: Model.from_dh([[0, 0, 0, 0]], masses=[1, 2]), "masses"),
        (lambda: Model.from_dh([[0, 0, 0, 0]], coms=[0, 0, 0]), "coms"),
        (lambda: Model.from_dh([[0, 0, 0, 0]], inertias=np.eye(3)), "inertias"),
    ],
)
def test_error_names_the_argument(make, argument):
    with pytest.raises(InputError, match=f"^{argument}.*: got .*expected"):
        make()


# ---- Denavit and Hartenberg ----------------------------------------------------------------------------------------


def along(axis, length, angle):
    """4×4 matrix of a screw along x (0) or z (2), each entry as in the textbooks."""
    c, s = np.cos(angle), np.sin(angle)
    if axis == 0:
        return np.array([[1, 0, 0, length], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, length], [0, 0, 0, 1]])


def link_frames(rows, joints, q, convention):
    """Link frames of a table in the base frame, as products of the 4×4 matrices of the convention."""
    frame, out = np.eye(4), []
    for (a, alpha, d, theta), joint, x in zip(rows, joints, q, strict=True):
        moved = along(2, d + x, theta) if joint == "prismatic" else along(2, d, theta + x)
        link = along(0, a, alpha)
        frame = frame @ (moved @ link if convention == "standard" else link @ moved)
        out.append(frame)
    return np.array(out)


def random_arm(n, seed):
    """Rows, joints, masses, centres of mass and inertias of an arm, in the link frames."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-1, 1, (n, 4)) * [1, np.pi, 1, np.pi]
    bodies = Model.random(n, seed)
    return rows, rng.choice(["revolute", "prismatic"], n).tolist(), bodies.masses, bodies.coms, bodies.inertias


@pytest.mark.parametrize("convention", ["standard", "modified"])
@given(n=st.integers(1, 8), seed=seeds)
def test_dh_frames_are_the_product_of_dh_matrices(convention, n, seed):
    rows, joints, masses, coms, inertias = random_arm(n, seed)
    model = Model.from_dh(rows, joints, convention=convention, masses=masses, coms=coms, inertias=inertias)
    q = model.random_state(seed=seed)[0]
    frames = link_frames(rows, joints, q, convention)
    rotations, origins = placements(model, q)
    centres = origins + np.einsum("nij,nj->ni", rotations, model.coms)
    wanted = frames[:, :3, 3] + np.einsum("nij,nj->ni", frames[:, :3, :3], coms)
    assert np.allclose(centres, wanted, rtol=0, atol=1e-13)
    assert np.allclose(model.masses, masses)
    turned = rotations @ model.inertias @ rotations.swapaxes(1, 2)
    assert np.allclose(turned, frames[:, :3, :3] @ inertias @ frames[:, :3, :3].swapaxes(1, 2), rtol=0, atol=1e-13)


PUMA = np.array(  # a, alpha, d, theta of the PUMA 560, standard convention (Corke and Armstrong 1994)
    [
        [0, np.pi / 2, 0, 0], [0.4318, 0, 0, 0], [0.0203, -np.pi / 2, 0.15005, 0],
        [0, np.pi / 2, 0.4318, 0], [0, -np.pi / 2, 0, 0], [0, 0, 0, 0],
    ]
)  # fmt: skip


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_dh_arm_has_the_torque_of_a_model_built_joint_by_joint(convention):
    """The model's joints stand at the previous link frame (standard) or past a and alpha (modified)."""
    rng = np.random.default_rng(0)
    _, _, masses, coms, inertias = random_arm(6, 3)
    joints = ["revolute", "revolute", "prismatic", "revolute", "revolute", "revolute"]
    pin_model, hook = pinocchio.Model(), pinocchio.SE3.Identity()
    for i, (a, alpha, d, theta) in enumerate(PUMA):
        link, fixed = pinocchio.SE3(along(0, a, alpha)), pinocchio.SE3(along(2, d, theta))
        joint = pinocchio.JointModelRZ() if joints[i] == "revolute" else pinocchio.JointModelPZ()
        body = pinocchio.Inertia(masses[i], coms[i], inertias[i])
        if convention == "standard":  # joint, then d and theta, then a and alpha up to the link frame
            pin_model.addJoint(i, joint, hook, f"j{i}")
            hook = fixed * link
            pin_model.appendBodyToJoint(i + 1, body, hook)
        else:
            pin_model.addJoint(i, joint, link, f"j{i}")
            pin_model.appendBodyToJoint(i + 1, body, fixed)
            pin_model.jointPlacements[i + 1] = hook * link
            hook = fixed
    q, v, a = rng.normal(size=(3, 6))
    model = Model.from_dh(PUMA, joints, convention=convention, masses=masses, coms=coms, inertias=inertias)
    assert relative_error(mp2a.rnea(model, q, v, a), pinocchio.rnea(pin_model, pin_model.createData(), q, v, a)) < 1e-13


# ---- pinocchio -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", ALL_JOINTS)
@given(n=st.integers(1, 6), seed=seeds)
@settings(max_examples=30)
def test_chain_comes_back_from_pinocchio(joint, n, seed):
    model = Model.random(n, seed, (joint,), branching=2)
    back = Model.from_pinocchio(model.to_pinocchio())
    if joint == "continuous":  # pinocchio divides a skew axis of this type by its length once more
        assert np.abs(back.axes - model.axes).max() <= 2**-52
        back = dataclasses.replace(back, axes=model.axes)
    assert back == model


@pytest.mark.parametrize("joint", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (-0.0, 1, 0)])
def test_aligned_axes_come_back_from_pinocchio(joint, axis):
    model = Model.uniform(3, joint, axis)
    assert Model.from_pinocchio(model.to_pinocchio()) == model


@pytest.mark.parametrize(
    "joint",
    [
        pinocchio.JointModelHX(0.1),
        pinocchio.JointModelSphericalZYX(),
        pinocchio.JointModelTranslation(),
        pinocchio.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])),
        pinocchio.JointModelComposite(pinocchio.JointModelRX()),
    ],
)
def test_unknown_joint_type_is_refused_by_name(joint):
    pin_model = pinocchio.Model()
    pin_model.addJoint(0, joint, pinocchio.SE3.Identity(), "elbow")
    with pytest.raises(InputError, match=f"joint 'elbow' is a {pin_model.joints[1].shortname()}"):
        Model.from_pinocchio(pin_model)


def test_model_that_is_more_than_a_chain_is_refused():
    with pytest.raises(InputError, match="without joints"):
        Model.from_pinocchio(pinocchio.Model())


# ---- URDF ----------------------------------------------------------------------------------------------------------


def urdf(*joints):
    """Robot of joints ``(type, parent link, child link)``, each with its own placement, axis and inertia."""
    links = sorted({name for _, *ends in joints for name in ends})
    lines = ['<?xml version="1.0"?>', '<robot name="arm">']
    for i, name in enumerate(links, start=1):
        lines.append(
            f'<link name="{name}"><inertial><origin xyz="0.1 0.{i} -0.2" rpy="0.3 0.1 0.{i}"/><mass value="{i}.5"/>'
            f'<inertia ixx="0.3" iyy="0.2{i}" izz="0.25" ixy="0.01" ixz="-0.02" iyz="0.03"/></inertial></link>'
        )
    for i, (kind, parent, child) in enumerate(joints, start=1):
        lines.append(
            f'<joint name="{parent}-{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0.{i} -0.2 0.3" rpy="0.{i} 1.1 -0.4"/><axis xyz="1 {i} -2"/>'
            '<limit lower="-3" upper="3" effort="10" velocity="5"/></joint>'
        )
    return "\n".join([*lines, "</robot>"])


def test_urdf_arm_has_pinocchios_torque(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        urdf(
            ("fixed", "world", "pedestal"), ("revolute", "pedestal", "l1"), ("continuous", "l1", "l2"),
            ("fixed", "l2", "bracket"), ("prismatic", "bracket", "l3"), ("fixed", "l3", "l4"),
            ("continuous", "l4", "l5"), ("fixed", "l5", "tool"),
        )
    )  # fmt: skip
    model = Model.from_urdf(path)
    pin_model = pinocchio.buildModelFromUrdf(str(path))
    assert model.joints == ("revolute", "continuous", "prismatic", "continuous")
    assert model.names == ("pedestal-l1", "l1-l2", "bracket-l3", "l4-l5")
    q, v, a = model.random_state(5)
    expected = [pinocchio.rnea(pin_model, pin_model.createData(), *x) for x in zip(q, v, a, strict=True)]
    assert relative_error(mp2a.rnea(model, q, v, a), np.array(expected)) < 1e-13


@pytest.mark.parametrize("method", ["serial", "compact", "sweep"])
def test_urdf_of_a_quadruped_is_the_tree_pinocchio_reads(tmp_path, method):
    """A free trunk, four legs of three joints, a neck and a fixed head, in pinocchio's joint order."""
    joints = [("floating", "world", "trunk"), ("revolute", "trunk", "neck"), ("fixed", "neck", "head")]
    for leg in ("front_left", "front_right", "hind_left", "hind_right"):
        joints += [("revolute", "trunk", f"{leg}_hip"), ("revolute", f"{leg}_hip", f"{leg}_thigh")]
        joints += [("prismatic", f"{leg}_thigh", f"{leg}_foot")]
    path = tmp_path / "quadruped.urdf"
    path.write_text(urdf(*joints))
    model, pin_model = Model.from_urdf(path), pinocchio.buildModelFromUrdf(str(path))
    assert not model.is_serial
    assert model.names == tuple(pin_model.names)[1:]
    assert len(model) == 14
    q, v, a = model.random_state(3)
    expected = [pinocchio.rnea(pin_model, pin_model.createData(), *x) for x in zip(q, v, a, strict=True)]
    assert relative_error(mp2a.rnea(model, q, v, a, method=method), np.array(expected)) < 1e-12


def test_pinocchios_own_humanoid():
    pin_model = pinocchio.buildSampleModelHumanoidRandom(True)
    model = Model.from_pinocchio(pin_model)
    state = model.random_state()
    expected = pinocchio.rnea(pin_model, pin_model.createData(), *state)
    for method in ("serial", "compact", "sweep"):
        assert relative_error(mp2a.rnea(model, *state, method=method), expected) < 1e-12


@pytest.mark.parametrize(("kind", "joint"), [("floating", "free"), ("planar", "planar")])
def test_urdf_joints_of_several_degrees_of_freedom(tmp_path, kind, joint):
    text = urdf((kind, "world", "body"), ("revolute", "body", "arm")).replace('xyz="1 1 -2"', 'xyz="0 0 1"')
    (tmp_path / "rover.urdf").write_text(text)
    model = Model.from_urdf(str(tmp_path / "rover.urdf"))
    pin_model = pinocchio.buildModelFromUrdf(str(tmp_path / "rover.urdf"))
    assert model.joints == (joint, "revolute")
    state = model.random_state()
    assert relative_error(mp2a.rnea(model, *state), pinocchio.rnea(pin_model, pin_model.createData(), *state)) < 1e-13


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (urdf(("fixed", "base", "tip")).encode(), "cannot be read as URDF .*without joints"),
        (urdf(("sliding", "base", "tip")).encode(), "cannot be read as URDF"),
        (urdf(("revolute", "a", "b"), ("revolute", "b", "a")).encode(), "cannot be read as URDF"),
        (b"", "cannot be read as URDF"),
        (b"not XML", "cannot be read as URDF"),
        (b"\xff\xfe\x00", "cannot be read as URDF"),
        (b'<?xml version="1.0" encoding="none"?><robot/>', "cannot be read as URDF"),
        (b"<sdf/>", "<sdf> as its root, expected <robot>"),
        (urdf(("revolute", "a", "b"), ("revolute", "b", "c"), ("revolute", "d", "d")).encode(), "hang on 'a'.*no loop"),
        (urdf(("revolute", "a", "c"), ("revolute", "b", "c")).encode(), "link 'c' is the child of joints 'a-c' and"),
        (urdf(("revolute", "a", "b"), ("revolute", "a", "b")).encode(), "there are two joints 'a-b'"),
        (urdf(("revolute", "a", "b")).replace('name="b"', 'name="a"').encode(), "there are two links 'a'"),
        (urdf(("revolute", "a", "b")).replace('name="b"', 'name="c"').encode(), "joint 'a-b': got link 'b', expected"),
        (urdf(("planar", "a", "b")).encode(), "'a-b': got a planar joint of axis"),
        *(
            (urdf(("revolute", "a", "b")).replace(old, new).encode(), f"{where}: got .*{got}.*expected")
            for old, new, where, got in (
                ('value="2.5"', 'value="nan"', "link 'b'", "value='nan' in <mass>"),
                ('value="2.5"', 'value="inf"', "link 'b'", "value='inf'"),
                ('value="2.5"', 'value="abc"', "link 'b'", "value='abc'"),
                ('value="2.5"', 'value="1 2"', "link 'b'", "value='1 2'"),
                ('value="2.5"', 'value="-1"', "link 'b'", "mass -1"),
                ('value="2.5"', "", "link 'b'", "no value in <mass>"),
                ('<mass value="2.5"/>', "", "link 'b'", "no <mass> in <inertial>"),
                ('iyy="0.22"', "", "link 'b'", "no iyy in <inertia>"),
                ('iyy="0.22"', 'iyy="big"', "link 'b'", "iyy='big'"),
                ('xyz="0.1 -0.2 0.3"', 'xyz="0.1 -0.2"', "joint 'a-b'", "xyz='0.1 -0.2'"),
                ('rpy="0.1 1.1 -0.4"', 'rpy="x 1.1 -0.4"', "joint 'a-b'", "rpy="),
                ('xyz="1 1 -2"', 'xyz="nan 1 -2"', "joint 'a-b'", "xyz="),
                ('xyz="1 1 -2"', 'direction="1 1 -2"', "joint 'a-b'", "no xyz in <axis>"),
                ('<parent link="a"/>', "", "joint 'a-b'", "no <parent>"),
                ('type="revolute"', "", "joint 'a-b'", "no type"),
            )
        ),
        (b'<robot name="r"/>', "cannot be read as URDF"),
    ],
)
def test_urdf_that_is_no_serial_chain_gives_an_input_error(tmp_path, content, message):
    path = tmp_path / "wrong.urdf"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        Model.from_urdf(path)


@given(data=st.data(), seed=seeds)
@settings(max_examples=40)
def test_urdf_of_any_tree_is_read_as_pinocchio_reads_it(tmp_path, data, seed):
    """Types, fixed links between and beyond, bare links, roots, and the order of joints, which goes by their names."""
    rng = np.random.default_rng(seed)
    names = rng.permutation([f"{letter}{i}" for letter in "Aaz_" for i in (1, 2, 10)])[: data.draw(st.integers(2, 12))]
    kinds = ["revolute", "continuous", "prismatic", "floating", "planar", "fixed", "fixed"]
    joints = [("revolute", names[0], names[1])]
    joints += [(rng.choice(kinds), names[rng.integers(0, i)], names[i]) for i in range(2, len(names))]
    text = urdf(*(joints[i] for i in rng.permutation(len(joints))))
    lines = [
        line.split("<inertial>")[0] + "</link>" if line.startswith("<link") and rng.random() < 0.2 else line
        for line in text.replace('<axis xyz="1 2 -2"/>', "").splitlines()
    ]
    lines = [re.sub("<axis.*?/>", "", line) if "planar" in line else line for line in lines]
    path = tmp_path / "tree.urdf"
    path.write_text("\n".join(lines))
    root, pin_root = data.draw(st.sampled_from([
        ("fixed", ()), ("free", (pinocchio.JointModelFreeFlyer(),)), ("planar", (pinocchio.JointModelPlanar(),)),
        ("spherical", (pinocchio.JointModelSpherical(),)),
    ]))  # fmt: skip
    model, pin_model = Model.from_urdf(path, root), pinocchio.buildModelFromUrdf(str(path), *pin_root)
    other = Model.from_pinocchio(pin_model)
    assert (model.names, model.joints, model.parents.tolist()) == (other.names, other.joints, other.parents.tolist())
    for field in ("axes", "rotations", "translations", "masses", "coms", "inertias"):
        assert np.allclose(getattr(model, field), getattr(other, field), rtol=0, atol=1e-13), field


@pytest.mark.parametrize("root", ["free", "planar"])
def test_urdf_stands_on_the_root_that_is_asked_for(tmp_path, root):
    path = tmp_path / "arm.urdf"
    path.write_text(urdf(("revolute", "trunk", "arm"), ("fixed", "arm", "hand")))
    model = Model.from_urdf(path, root=root)
    assert model.joints == (root, "revolute")
    assert model.names == ("root_joint", "trunk-arm")
    assert model.masses.sum() == 1.5 + 2.5 + 3.5
    with pytest.raises(InputError, match=r"^root: got 'floating', expected one of 'fixed', 'free'"):
        Model.from_urdf(path, root="floating")


def test_urdf_of_ten_thousand_links_in_a_row(tmp_path):
    path = tmp_path / "rope.urdf"
    path.write_text(urdf(*(("revolute", f"l{i:05}", f"l{i + 1:05}") for i in range(10_000))))
    model = Model.from_urdf(path)
    assert len(model) == 10_000
    assert model.is_serial


def test_gravity_comes_and_goes_with_pinocchios_model(tmp_path):
    pin_model = Model.uniform(3).to_pinocchio()
    assert np.array_equal(Model.from_pinocchio(pin_model).gravity, [0, 0, -9.81])
    pin_model.gravity.linear = np.array([0.0, 0.0, -1.62])
    moon = Model.from_pinocchio(pin_model)
    assert np.array_equal(moon.gravity, [0, 0, -1.62])
    assert np.array_equal(moon.to_pinocchio().gravity.linear, [0, 0, -1.62])
    assert moon != Model.uniform(3)
    moon.save(tmp_path / "moon.npz")
    assert Model.load(tmp_path / "moon.npz") == moon
    pin_model.gravity.angular = np.array([0.0, 0.0, 1.0])
    with pytest.raises(InputError, match="gravity with an angular part"):
        Model.from_pinocchio(pin_model)


def test_urdf_that_cannot_be_opened_gives_an_input_error(tmp_path):
    for path in (tmp_path / "missing.urdf", tmp_path, "null\0character"):
        with pytest.raises(InputError, match=r"^path: .* cannot be read as URDF"):
            Model.from_urdf(path)
