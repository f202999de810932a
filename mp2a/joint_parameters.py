"""What a joint resists its motion with, beside the inertia of its body: the parameters, checked."""

from collections.abc import Mapping, Sequence

import numpy as np

from mp2a.checks import array, numbers
from mp2a.exceptions import InputError
from mp2a.joints import JOINTS
from mp2a.spatial import Array

JOINT_PARAMETERS = ("armature", "damping", "friction", "stiffness", "rest")
"""Fields of `mp2a.Model`; the last one has coordinates, the others numbers for each degree of freedom."""

_UNIT_TOLERANCE = 1e-6


def joint_parameters(joints: Sequence[str], values: Mapping[str, Array]) -> dict[str, Array]:
    """Check the fields `JOINT_PARAMETERS` of joints of these types, and fill in what is empty or zero throughout.

    Zeros of another length, and a rest position without springs, are those of a model whose joints were replaced.

    Raises
    ------
    InputError
        If one has the wrong shape, is not finite or is negative, or a quaternion, or cosine and sine, of the rest
        position are not of length 1.
    """
    neutral = np.concatenate([JOINTS[joint].neutral for joint in joints])
    nv, out = sum(JOINTS[joint].nv for joint in joints), {}
    for name in JOINT_PARAMETERS[:-1]:
        out[name] = array(name, values[name], (nv,)) if numbers(name, values[name]).any() else np.zeros(nv)
        if (out[name] < 0).any():
            k = int(np.argmax(out[name] < 0))
            raise InputError(f"{name}: got {out[name][k]} for degree of freedom {k}, expected no negative number")
    given = numbers("rest", values["rest"]).size and out["stiffness"].any()
    out["rest"] = rest = array("rest", values["rest"], neutral.shape) if given else neutral
    start = 0
    for i, joint in enumerate(JOINTS[joint] for joint in joints):
        own = rest[start : start + joint.nq]
        start += joint.nq
        if joint.unit is not None and abs(np.linalg.norm(own[joint.unit]) - 1) > _UNIT_TOLERANCE:
            raise InputError(f"rest: got {own.tolist()} for body {i}, a {joint.name} joint, expected length 1 in it")
    return out


def check_lengths(given: Mapping[str, Array], checked: Mapping[str, Array]) -> None:
    """Check that fields have the lengths that they have in a model, where nothing is to be filled in.

    Raises
    ------
    InputError
        Naming the field.
    """
    for name, array_ in checked.items():
        if given[name].shape != array_.shape:
            raise InputError(f"{name}: got shape {given[name].shape}, expected {array_.shape}")
