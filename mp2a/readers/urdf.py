"""Models from URDF files, in pinocchio's order of joints, so that q is pinocchio's q.

The file is read here rather than by pinocchio, whose parser takes numbers it cannot read for 0 and needs a stack as
deep as the robot.
"""

from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from mp2a.exceptions import InputError
from mp2a.joints import JOINTS
from mp2a.spatial import Array, inertia_at_origin

_KINDS = {
    "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic",
    "planar": "planar", "floating": "free", "fixed": None,
}  # fmt: skip
"""Joint types of URDF; a fixed joint is none."""

_ROOTS = ("fixed", "free", "planar", "spherical")


def read_urdf(path: str | Path, root: str) -> dict[str, Any]:
    """Return the fields for `Model.from_urdf`."""
    if root not in _ROOTS:
        raise InputError(f"root: got {root!r}, expected one of {', '.join(map(repr, _ROOTS))}")
    try:
        robot = ElementTree.fromstring(Path(path).read_bytes())
    except (OSError, ValueError, LookupError, ElementTree.ParseError) as error:
        raise InputError(f"path: {path} cannot be read as URDF ({error})") from error
    try:
        if robot.tag != "robot":
            raise _WrongError(f"it has <{robot.tag}> as its root, expected <robot>")
        return _assemble(_links(robot), _joints(robot), root)
    except _WrongError as error:
        raise InputError(f"path: {path} cannot be read as URDF ({error})") from None


class _WrongError(Exception):
    """What is wrong with a file."""


class _Pose(NamedTuple):
    rotation: Array
    translation: Array

    def then(self, inner: "_Pose") -> "_Pose":
        return _Pose(self.rotation @ inner.rotation, self.translation + self.rotation @ inner.translation)


class _Body(NamedTuple):
    """Mass, mass times centre of mass, and rotational inertia about the origin: what adds up."""

    mass: float
    moment: Array
    inertia: Array

    def seen_from(self, pose: _Pose) -> "_Body":
        """Return the same about the origin of the frame in which this body's frame has a pose."""
        com = self.moment / self.mass if self.mass else np.zeros(3)
        central = self.inertia - inertia_at_origin(np.array(self.mass), com, np.zeros((3, 3)))
        com = pose.translation + pose.rotation @ com
        return _about_origin(self.mass, com, pose.rotation @ central @ pose.rotation.T)

    def and_also(self, other: "_Body") -> "_Body":
        return _Body(self.mass + other.mass, self.moment + other.moment, self.inertia + other.inertia)


def _about_origin(mass: float, com: Array, inertia: Array) -> _Body:
    return _Body(mass, mass * com, inertia_at_origin(np.array(mass), com, inertia))


_HERE = _Pose(np.eye(3), np.zeros(3))
_NOTHING = _Body(0.0, np.zeros(3), np.zeros((3, 3)))


class _Joint(NamedTuple):
    name: str
    kind: str | None
    parent: str
    child: str
    pose: _Pose
    axis: Array
    damping: float = 0.0
    friction: float = 0.0


# ---- from the text ---------------------------------------------------------------------------------------------------


def _links(robot: Element) -> dict[str, _Body]:
    links: dict[str, _Body] = {}
    for element in robot.findall("link"):
        name = _attribute(element, "name", "a link")
        if name in links:
            raise _WrongError(f"there are two links {name!r}")
        links[name] = _body(element, f"link {name!r}")
    if not links:
        raise _WrongError("it has no link")
    return links


def _body(link: Element, where: str) -> _Body:
    inertial = link.find("inertial")
    if inertial is None:
        return _NOTHING
    (mass,) = _numbers(_child(inertial, "mass", where), "value", where, 1)
    if mass < 0:
        raise _WrongError(f"{where}: got mass {mass}, expected no negative mass")
    tensor = _child(inertial, "inertia", where)
    xx, xy, xz, yy, yz, zz = (
        _numbers(tensor, name, where, 1)[0] for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    pose = _pose(inertial, where)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return _about_origin(mass, pose.translation, pose.rotation @ inertia @ pose.rotation.T)


def _joints(robot: Element) -> list[_Joint]:
    joints: dict[str, _Joint] = {}
    for element in robot.findall("joint"):
        name = _attribute(element, "name", "a joint")
        where = f"joint {name!r}"
        kind = _attribute(element, "type", where)
        if name in joints:
            raise _WrongError(f"there are two joints {name!r}")
        if kind not in _KINDS:
            raise _WrongError(f"{where}: got type {kind!r}, expected one of {', '.join(_KINDS)}")
        parent, child = (_attribute(_child(element, end, where), "link", where) for end in ("parent", "child"))
        axis = element.find("axis")
        direction = np.array([1.0, 0.0, 0.0]) if axis is None else _numbers(axis, "xyz", where, 3)
        if kind == "planar" and axis is not None and (direction[:2].any() or direction[2] <= 0):
            raise _WrongError(f"{where}: got a planar joint of axis {direction}, expected 0 0 1")
        joints[name] = _Joint(
            name, _KINDS[kind], parent, child, _pose(element, where), direction, *_dynamics(element, where)
        )
    return list(joints.values())


def _dynamics(joint: Element, where: str) -> tuple[float, float]:
    """Damping and dry friction of a joint, the same along each of its directions."""
    dynamics = joint.find("dynamics")
    if dynamics is None:
        return 0.0, 0.0
    (damping,), (friction,) = (_numbers(dynamics, name, where, 1, "0") for name in ("damping", "friction"))
    if damping < 0 or friction < 0:
        raise _WrongError(f"{where}: got damping {damping} and friction {friction}, expected no negative ones")
    return damping, friction


def _pose(element: Element, where: str) -> _Pose:
    origin = element.find("origin")
    if origin is None:
        return _HERE
    xyz, rpy = (_numbers(origin, name, where, 3, "0 0 0") for name in ("xyz", "rpy"))
    (cx, cy, cz), (sx, sy, sz) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return _Pose(about_z @ about_y @ about_x, xyz)


def _child(element: Element, tag: str, where: str) -> Element:
    child = element.find(tag)
    if child is None:
        raise _WrongError(f"{where}: got no <{tag}> in <{element.tag}>, expected one")
    return child


def _attribute(element: Element, name: str, where: str, default: str | None = None) -> str:
    text = element.get(name, default)
    if text is None:
        raise _WrongError(f"{where}: got no {name} in <{element.tag}>, expected one")
    return text


def _numbers(element: Element, name: str, where: str, count: int, default: str | None = None) -> Array:
    text = _attribute(element, name, where, default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        expected = "a finite number" if count == 1 else f"{count} finite numbers"
        raise _WrongError(f"{where}: got {name}={text!r} in <{element.tag}>, expected {expected}")
    return values


# ---- from links and joints to bodies ---------------------------------------------------------------------------------


def _assemble(links: dict[str, _Body], joints: list[_Joint], root: str) -> dict[str, Any]:
    """Put links that are fixed to each other together; bodies in depth-first order, children by names of joints."""
    first = _root_link(links, joints)
    children: dict[str, list[_Joint]] = {name: [] for name in links}
    for joint in sorted(joints, key=lambda joint: joint.name, reverse=True):
        children[joint.parent].append(joint)
    start = _Joint("root_joint", None if root == "fixed" else root, "", first, _HERE, np.zeros(3))
    left = [(start, -1, _HERE)]  # joints, the body that each hangs on (-1: the world), and that body's link in it
    seen, parents, moving, poses, bodies = 0, [], [], [], []
    while left:
        joint, body, pose = left.pop()
        seen += 1
        pose = pose.then(joint.pose)
        if joint.kind is not None:
            parents.append(body)
            moving.append(joint)
            poses.append(pose)
            bodies.append(links[joint.child])
            body, pose = len(bodies) - 1, _HERE
        elif body >= 0:
            bodies[body] = bodies[body].and_also(links[joint.child].seen_from(pose))
        left.extend((child, body, pose) for child in children[joint.child])
    if seen < len(links):
        raise _WrongError(f"only {seen} of its {len(links)} links hang on {first!r}, expected no loop")
    if not bodies:
        raise _WrongError("it is a robot without joints, expected at least one that moves")
    degrees = [JOINTS[str(joint.kind)].nv for joint in moving]
    coms = [body.moment / body.mass if body.mass else np.zeros(3) for body in bodies]
    about_coms = [
        body.inertia - inertia_at_origin(np.array(body.mass), com, np.zeros((3, 3)))
        for body, com in zip(bodies, coms, strict=True)
    ]
    return {
        "parents": parents,
        "joints": tuple(str(joint.kind) for joint in moving),
        "axes": [joint.axis for joint in moving],
        "rotations": [pose.rotation for pose in poses],
        "translations": [pose.translation for pose in poses],
        "masses": [body.mass for body in bodies],
        "coms": coms,
        "inertias": about_coms,
        "names": tuple(joint.name for joint in moving),
        "damping": np.repeat([joint.damping for joint in moving], degrees),
        "friction": np.repeat([joint.friction for joint in moving], degrees),
    }


def _root_link(links: dict[str, _Body], joints: list[_Joint]) -> str:
    """Name the link that hangs on none, after a look at which link hangs on which."""
    held: dict[str, _Joint] = {}
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise _WrongError(f"joint {joint.name!r}: got link {link!r}, expected one that is there")
        if joint.child in held:
            names = f"{held[joint.child].name!r} and {joint.name!r}"
            raise _WrongError(f"link {joint.child!r} is the child of joints {names}, expected one")
        held[joint.child] = joint
    roots = [name for name in links if name not in held]
    if len(roots) != 1:
        raise _WrongError(f"got {len(roots)} links without a joint above them {roots[:3]}, expected one")
    return roots[0]
