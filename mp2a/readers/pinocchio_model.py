"""Models from and to `pinocchio.Model`."""

from typing import Any

import numpy as np
import pinocchio

from mp2a.exceptions import InputError
from mp2a.spatial import Array

_AXIAL = {"RUB": "continuous", "R": "revolute", "P": "prismatic"}
_PLAIN = {"JointModelFreeFlyer": "free", "JointModelSpherical": "spherical", "JointModelPlanar": "planar"}
_UNALIGNED = {
    "JointModelRevoluteUnboundedUnaligned": "continuous",
    "JointModelRevoluteUnaligned": "revolute",
    "JointModelPrismaticUnaligned": "prismatic",
}


def from_model(model: pinocchio.Model) -> dict[str, Any]:
    """Return the fields for `Model.from_pinocchio`."""
    n = model.njoints - 1
    if n == 0:
        raise InputError("model: got a pinocchio model without joints, expected at least one that moves")
    if np.any(model.gravity.angular):
        raise InputError(f"model: got gravity with an angular part {model.gravity.angular}, expected a linear field")
    joints, axes = [], np.zeros((n, 3))
    for i in range(n):
        kind = _kind(model.joints[i + 1].shortname())
        if kind is None:
            raise InputError(
                f"model: joint {model.names[i + 1]!r} is a {model.joints[i + 1].shortname()}, which mp2a does not know"
            )
        joints.append(kind)
        if kind in _AXIAL.values():
            axes[i] = _axis(model, i + 1)
    bodies = [model.inertias[i + 1] for i in range(n)]
    return {
        "parents": np.array([model.parents[i + 1] - 1 for i in range(n)]),
        "joints": tuple(joints),
        "axes": axes,
        "rotations": np.array([model.jointPlacements[i + 1].rotation for i in range(n)]),
        "translations": np.array([model.jointPlacements[i + 1].translation for i in range(n)]),
        "masses": np.array([body.mass for body in bodies]),
        "coms": np.array([body.lever for body in bodies]),
        "inertias": np.array([body.inertia for body in bodies]),
        "names": tuple(model.names[i + 1] for i in range(n)),
        "gravity": np.array(model.gravity.linear),
        "armature": np.array(model.armature),
        "damping": np.array(model.damping),
        "friction": np.where(
            model.lowerDryFrictionLimit == -model.upperDryFrictionLimit, model.upperDryFrictionLimit, 0.0
        ),
    }


def to_model(fields: dict[str, Any]) -> pinocchio.Model:
    """Make a `pinocchio.Model` of a model's fields, for `Model.to_pinocchio`."""
    model = pinocchio.Model()
    model.name = "mp2a"
    model.gravity.linear = fields["gravity"]
    for i, parent in enumerate(fields["parents"]):
        placement = pinocchio.SE3(fields["rotations"][i], fields["translations"][i])
        joint = _joint_model(str(fields["joints"][i]), fields["axes"][i])
        index = model.addJoint(int(parent) + 1, joint, placement, str(fields["names"][i]))
        body = pinocchio.Inertia(float(fields["masses"][i]), fields["coms"][i], fields["inertias"][i])
        model.inertias[index] = body  # appendBodyToJoint would go through a weighted mean and lose the last bit
    model.armature, model.damping = fields["armature"], fields["damping"]
    model.upperDryFrictionLimit, model.lowerDryFrictionLimit = fields["friction"], -fields["friction"]
    return model


def _kind(shortname: str) -> str | None:
    if shortname in _PLAIN or shortname in _UNALIGNED:
        return _PLAIN.get(shortname) or _UNALIGNED[shortname]
    return _AXIAL.get(shortname.removeprefix("JointModel")[:-1]) if shortname[-1] in "XYZ" else None


def _axis(model: pinocchio.Model, index: int) -> Array:
    """Axis of a joint with one degree of freedom, from its motion subspace, which every such joint shows."""
    joint = model.joints[index]
    data = joint.createData()
    joint.calc(data, pinocchio.neutral(model))
    subspace = np.asarray(data.S).reshape(6)
    return subspace[:3] + subspace[3:]


def _joint_model(kind: str, axis: Array) -> Any:
    plain = {name: shortname for shortname, name in _PLAIN.items()}
    if kind in plain:
        return getattr(pinocchio, plain[kind])()
    prefix = {name: letters for letters, name in _AXIAL.items()}[kind]
    for letter, unit in zip("XYZ", np.eye(3), strict=True):
        if (axis == unit).all():
            return getattr(pinocchio, f"JointModel{prefix}{letter}")()
    if kind == "continuous":
        return _unaligned_continuous(axis)
    unaligned = {name: shortname for shortname, name in _UNALIGNED.items()}
    return getattr(pinocchio, unaligned[kind])(axis)


def _unaligned_continuous(axis: Array) -> Any:
    """Unbounded joint about any axis; pinocchio's Python has no constructor for it, but its URDF reader does."""
    xyz = " ".join(repr(float(x)) for x in axis)
    text = (
        '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="{xyz}"/></joint></robot>'
    )
    return pinocchio.buildModelFromXML(text).joints[1].extract()
