"""Joints place and move bodies as pinocchio's do, and as their own subspace says."""

import numpy as np
import pinocchio
import pytest
from helpers import ALL_JOINTS, derivative, relative_error
from hypothesis import given
from hypothesis import strategies as st

from mp2a import Model
from mp2a.joints import JOINTS

every_joint = pytest.mark.parametrize("name", ALL_JOINTS)
seeds = st.integers(0, 2**32 - 1)


def lone_joint(name, seed):
    """A joint, a chain of it alone at the base, and random q and v."""
    fields = Model.random(1, seed=seed, joints=(name,))
    model = Model([-1], (name,), fields.axes, [np.eye(3)], [[0, 0, 0]], [1.0], [[0, 0, 0]], [np.eye(3)])
    return JOINTS[name], model, *model.random_state(seed=seed)[:2]


def rates(name, q, v):
    """Derivative of q for a velocity v, written down anew for each type."""
    if name in ("revolute", "prismatic"):
        return v
    if name == "continuous":
        return np.array([-q[1], q[0]]) * v
    if name == "planar":
        (c, s), (x, y, turn) = q[2:], v
        return np.array([c * x - s * y, s * x + c * y, -s * turn, c * turn])
    imaginary, real = q[-4:-1], q[-1]
    w = v[-3:]
    spin = np.append(real * w + np.cross(imaginary, w), -imaginary @ w) / 2
    if name == "spherical":
        return spin
    return np.concatenate((JOINTS["free"].transform(np.zeros((1, 3)), q[None, None])[0][0, 0] @ v[:3], spin))


@every_joint
@given(seed=seeds)
def test_placement_and_subspace_are_pinocchios(name, seed):
    joint, model, q, v = lone_joint(name, seed)
    pin_model = model.to_pinocchio()
    data = pin_model.createData()
    pinocchio.forwardKinematics(pin_model, data, q, v)
    rotation, translation = (x[0, 0] for x in joint.transform(model.axes, q[None, None]))
    assert relative_error(rotation, data.oMi[1].rotation) < 1e-14
    assert np.allclose(translation, data.oMi[1].translation, rtol=0, atol=1e-14)
    motion = joint.subspace(model.axes)[0] @ v
    assert relative_error(np.roll(motion, 3), data.v[1].vector) < 1e-14
    assert (pin_model.nq, pin_model.nv) == (joint.nq, joint.nv)


@every_joint
@given(seed=seeds)
def test_placement_changes_as_the_subspace_says(name, seed):
    joint, model, q, v = lone_joint(name, seed)
    rotation = joint.transform(model.axes, q[None, None])[0][0, 0]
    q_dot = rates(name, q, v)
    turning, moving = (
        derivative(lambda t, part=part: joint.transform(model.axes, (q + t * q_dot)[None, None])[part][0, 0], 1e-3)
        for part in (0, 1)
    )
    spin = rotation.T @ turning
    twist = np.concatenate(([spin[2, 1], spin[0, 2], spin[1, 0]], rotation.T @ moving))
    assert relative_error(twist, joint.subspace(model.axes)[0] @ v) < 1e-9


@every_joint
def test_neutral_moves_nothing(name):
    joint, model, _, _ = lone_joint(name, 0)
    rotation, translation = joint.transform(model.axes, model.neutral[None, None])
    assert np.array_equal(rotation[0, 0], np.eye(3))
    assert not translation.any()


@every_joint
@given(seed=seeds)
def test_transform_is_a_rotation_when_the_unit_part_has_length_one(name, seed):
    joint, model, q, _ = lone_joint(name, seed)
    rotation = joint.transform(model.axes, q[None, None])[0][0, 0]
    assert relative_error(rotation @ rotation.T, np.eye(3)) < 1e-14
    assert np.linalg.det(rotation) > 0
    if joint.unit is not None:
        assert np.isclose(np.linalg.norm(np.array(joint.neutral)[joint.unit]), 1.0)
        stretched = q.copy()
        stretched[joint.unit] *= 1.1
        rotation = joint.transform(model.axes, stretched[None, None])[0][0, 0]
        assert relative_error(rotation @ rotation.T, np.eye(3)) > 1e-3
