"""A cross-check by MuJoCo, which shares no code with pinocchio."""

import numpy as np
import pytest
from helpers import relative_error
from hypothesis import given
from hypothesis import strategies as st

import mp2a
from mp2a import Model

mujoco = pytest.importorskip("mujoco")

JOINTS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "spherical": "ball"}


def numbers(array):
    return " ".join(repr(float(x)) for x in np.ravel(array))


def mjcf(model, gravity):
    """MuJoCo's description of a serial chain: bodies within bodies."""
    lines = [
        '<mujoco><compiler angle="radian"/>',
        f'<option gravity="{numbers(gravity)}"><flag contact="disable" constraint="disable"/></option><worldbody>',
    ]
    for i, joint in enumerate(model.joints):
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, model.rotations[i].ravel())
        inertia = model.inertias[i][[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        axis = "" if joint == "spherical" else f'axis="{numbers(model.axes[i])}"'
        lines.append(
            f'<body pos="{numbers(model.translations[i])}" quat="{numbers(quaternion)}">'
            f'<joint type="{JOINTS[joint]}" {axis}/><inertial pos="{numbers(model.coms[i])}" '
            f'mass="{float(model.masses[i])!r}" fullinertia="{numbers(inertia)}"/>'
        )
    return "\n".join([*lines, "</body>" * len(model), "</worldbody></mujoco>"])


def mujoco_coordinates(model, q):
    """Coordinates in MuJoCo's convention: quaternions with w first, an angle for a cosine and sine."""
    out = []
    for i, joint in enumerate(model.joints):
        own = q[model.q_starts[i] : model.q_starts[i + 1]]
        if joint == "spherical":
            own = np.roll(own, 1)
        elif joint == "continuous":
            own = [np.arctan2(own[1], own[0])]
        out.extend(own)
    return np.array(out)


@pytest.mark.parametrize("method", ["serial", "kogge-stone"])
@given(n=st.integers(1, 20), seed=st.integers(0, 2**32 - 1))
def test_torque_is_mujocos(method, n, seed):
    model = Model.random(n, seed, tuple(JOINTS))
    gravity = np.random.default_rng(seed).normal(scale=5.0, size=3)
    q, v, a = model.random_state(seed=seed)
    mj_model = mujoco.MjModel.from_xml_string(mjcf(model, gravity))
    data = mujoco.MjData(mj_model)
    data.qpos, data.qvel, data.qacc = mujoco_coordinates(model, q), v, a
    mujoco.mj_inverse(mj_model, data)
    assert relative_error(mp2a.rnea(model, q, v, a, gravity=gravity, method=method), data.qfrc_inverse) <= 1e-10
