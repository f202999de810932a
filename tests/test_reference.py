"""The reference is pinocchio itself, and says so before it takes more memory than there is."""

import numpy as np
import pinocchio
import pytest
from helpers import ALL_JOINTS, random_load, relative_error

from mp2a import DependencyError, Model, reference
from mp2a.cores import available_memory
from mp2a.reference import Reference, data_bytes
from mp2a.spatial import to_linear_first

MODEL = Model.random(9, seed=4, joints=ALL_JOINTS)


def test_torque_is_what_pinocchio_returns():
    q, v, a = MODEL.random_state(3)
    forces, gravity = random_load(MODEL, 3)
    result = Reference(MODEL).rnea(q, v, a, forces, gravity)
    pin_model = MODEL.to_pinocchio()
    pin_model.gravity.linear = gravity
    for t in range(3):
        loads = [pinocchio.Force.Zero(), *(pinocchio.Force(f) for f in to_linear_first(forces[t]))]
        expected = pinocchio.rnea(pin_model, pin_model.createData(), q[t], v[t], a[t], pinocchio.StdVec_Force(loads))
        assert np.array_equal(result.torque[t], expected)


def test_motion_is_pinocchios_in_the_papers_convention():
    q, v, a = MODEL.random_state()
    gravity = np.array([1.0, -2.0, 3.0])
    result = Reference(MODEL).rnea(q, v, a, gravity=gravity)
    pin_model = MODEL.to_pinocchio()
    data = pin_model.createData()
    pinocchio.forwardKinematics(pin_model, data, q, v, a)
    frame = pinocchio.ReferenceFrame.LOCAL
    for i in range(len(MODEL)):
        assert relative_error(to_linear_first(result.velocity[i]), data.v[i + 1].vector) < 1e-14
        classical = pinocchio.getClassicalAcceleration(pin_model, data, i + 1, frame).vector
        classical[:3] -= data.oMi[i + 1].rotation.T @ gravity
        assert relative_error(to_linear_first(result.acceleration[i]), classical) < 1e-13


def test_one_sample_is_a_row_of_many():
    q, v, a = MODEL.random_state(4)
    forces, gravity = random_load(MODEL)
    whole = Reference(MODEL)
    many = whole.rnea(q, v, a, forces, gravity)
    for t in range(4):
        one = whole.rnea(q[t], v[t], a[t], forces, gravity)
        for name in ("velocity", "acceleration", "force", "torque"):
            assert np.array_equal(getattr(one, name), getattr(many, name)[t])


def test_default_gravity_is_pinocchios_whatever_was_asked_before():
    state = MODEL.random_state()
    used = Reference(MODEL)
    used.rnea(*state, gravity=(1, 2, 3))
    pin_model = MODEL.to_pinocchio()
    assert np.array_equal(used.rnea(*state).torque, pinocchio.rnea(pin_model, pin_model.createData(), *state))


def test_memory_is_refused_before_it_is_taken(monkeypatch):
    """And the refusal names the largest nv that fits."""
    model = Model.uniform(40)
    free = 8 * data_bytes(10) + 1.0
    monkeypatch.setattr(reference, "available_memory", lambda: free)
    with pytest.raises(DependencyError, match=r"nv = 40 takes .* GB .*up to nv = 20 fits") as error:
        Reference(model)
    assert "GB are free" in str(error.value)
    assert data_bytes(20) <= free < data_bytes(21)
    assert Reference(Model.uniform(20)).pin_model.nv == 20
    with pytest.raises(DependencyError):
        Reference(Model.uniform(21))


def test_free_memory_is_known_here():
    assert available_memory() > 1e6
