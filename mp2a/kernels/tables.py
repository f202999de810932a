"""What the compiled recursion needs of a chain: its frames chosen anew, its numbers in tables.

A body whose joint has one degree of freedom gets a frame of its own, with z along the joint's axis. Any constant
rotation between two such frames is one about z, one about x and one about z again. The first goes into the frame of the
parent, which may be turned about its axis as one likes, the last into the joint's angle. What is left, one turn about x
and one about z, takes half the arithmetic of a rotation matrix. A parent has only one such turn to give: of several
children, the others bring theirs along (`FORK`). Other bodies keep the user's frame.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.model import Model
from mp2a.spatial import Array, transpose

REVOLUTE, CONTINUOUS, PRISMATIC, SCREW, PLANAR, SPHERICAL, FREE = range(7)
_KINDS = {
    "revolute": REVOLUTE, "continuous": CONTINUOUS, "prismatic": PRISMATIC,
    "planar": PLANAR, "spherical": SPHERICAL, "free": FREE,
}  # fmt: skip
"""SCREW is no joint of the library: it turns or slides by shares, so that lanes with different joints do the same."""

KIND, Q_COLUMN, V_COLUMN, SLOT, FORCE, FROM, KEEP, RETURN, FORK, GAINS = range(10)
"""Columns of the table of whole numbers. Places are numbers from the start of the scratch memory: of what a body
leaves for the way back, of its wrench, of its parent's state (-1: the body before it is the parent), of its own state
if others need it (else -1), of the parent's wrench, and of what forward dynamics leaves of the joint."""

TOPOLOGY = 10
BODY_CONSTANTS = 24
"""Numbers a body in the first table: cosine and sine about x, place (3), mass, moment (3), inertia (6), angle, how much
a `SCREW` turns and slides, and the armature of each degree of freedom (6)."""

ARMATURE = 18
"""Where the armature begins."""

FRAME_CONSTANTS = 22
"""In the second: the user's frame (9), rotation of joints with several degrees of freedom (9), cosine and sine of the
turn that a fork brings along, cosine and sine of the joint's angle."""

CACHE_LINE = 64
"""Bytes. Vectors that lie across two lines take twice the time."""

GAIN, INERTIA = 7, 21
"""Numbers that forward dynamics keeps of a degree of freedom, and of a body's articulated inertia."""

_RINGS, _WRENCH = 3, 6


class NumberFormat(NamedTuple):
    """A number format of the kernels."""

    name: str
    lanes: int
    dtype: np.dtype


NUMBER_FORMATS = {
    np.dtype(np.float64): NumberFormat("double", 8, np.dtype(np.float64)),
    np.dtype(np.float32): NumberFormat("single", 16, np.dtype(np.float32)),
}

SCALAR = NumberFormat("scalar", 1, np.dtype(np.float64))
"""For one sample alone, which would leave all lanes but one empty."""


class KernelJob(NamedTuple):
    """What the kernel is to do; it gets these numbers in this order.

    Of arrays it gets the address of their pointer (`mp2a.kernels.pointer`), of strides the numbers to the next sample,
    or to the next column where the samples of a column lie together.
    """

    bodies: int
    samples: int
    nq: int
    nv: int
    columnwise: int
    """Whether the samples of a column lie together in q, v, a and the torque, else the columns of a sample."""
    body_constants: int
    frame_constants: int
    topology: int
    base: int
    """``(T or 1, 12)``: the base's angular velocity, angular acceleration, acceleration less gravity, velocity."""
    base_stride: int
    tip: int
    """``(T or 1, 6)``: wrench from outside on the last body. Where each lane has bodies of its own: what the last body
    passes on, in the frame of the tables."""
    tip_stride: int
    external: int
    """Wrenches from outside on all bodies, or 0."""
    external_body: int
    """Numbers to the next body's."""
    external_sample: int
    """Numbers to the next sample's; 0 if all samples have the same."""
    q: int
    q_stride: int
    v: int
    v_stride: int
    a: int
    a_stride: int
    torque: int
    torque_stride: int
    output: int
    """``(T, n, 18)``: velocity, acceleration and force of each body, where they are asked for."""
    padded: int
    """T, made a multiple of the lanes."""
    root: int
    """``(6, padded)``: wrench on the base."""
    backward_only: int
    """Whether to go the way back only, over what an earlier run left in the scratch memory."""


AT = KernelJob(*range(len(KernelJob._fields)))
"""Place of each number."""


@dataclass(frozen=True)
class ModelTables:
    """Tables of a chain for one number format.

    Attributes
    ----------
    body_constants, frame_constants
        ``(n, BODY_CONSTANTS)``, ``(n, FRAME_CONSTANTS)``
    topology
        ``(n, TOPOLOGY)``
    scratch
        Numbers of scratch memory that a thread needs.
    """

    body_constants: Array
    frame_constants: Array
    topology: NDArray[np.int64]
    scratch: int


class AxisFrames(NamedTuple):
    """Frames chosen anew, all bodies at once."""

    kinds: NDArray[np.intp]
    user: Array
    """``B (n, 3, 3)``: new frame to the user's."""
    general: Array
    """``(n, 3, 3)``: rotation at zero of joints with several degrees of freedom, identity for others."""
    places: Array
    """``(n, 3)`` in the parent's new frame, after the fork's turn."""
    about_x: Array
    angle: Array
    fork: Array
    """``(n,)`` rad each."""


def choose_frames(model: Model) -> AxisFrames:
    """Choose the frames of a chain's bodies."""
    n = len(model)
    kinds = np.array([_KINDS[joint] for joint in model.joints])
    single = kinds < PLANAR
    upright = np.tile(np.eye(3), (n, 1, 1))
    upright[single] = _upright(model.axes[single])
    parents = model.parents
    rooted = parents < 0
    above = np.where(rooted, 0, parents)
    outer = np.where(rooted[:, None, None], np.eye(3), upright[above])
    between = transpose(outer) @ model.rotations @ upright
    first, about_x, last = _turns(between)
    # The parent's own turn about its axis, given to its first child with one degree of freedom.
    own = np.zeros(n)
    heirs = np.flatnonzero(single & ~rooted & single[above])[::-1]
    own[parents[heirs]] = first[heirs]
    user = upright @ _about_z(own)
    fork = np.where(single, first - np.where(rooted, 0.0, own[above]), 0.0)
    angle = np.where(single, last + own, 0.0)
    outer = np.where(rooted[:, None, None], np.eye(3), user[above])
    inner = np.where(single[:, None, None], _about_z(fork), np.eye(3))
    places = np.einsum("nji,nkj,nk->ni", inner, outer, model.translations)
    general = np.where(single[:, None, None], np.eye(3), transpose(outer) @ model.rotations)
    return AxisFrames(kinds, user, general, places, np.where(single, about_x, 0.0), angle, fork)


def make_tables(model: Model, format_: NumberFormat, bodies: bool, forward_dynamics: bool = False) -> ModelTables:
    """Make the tables of a chain; with ``bodies`` for kernels whose states have 12 numbers, not 9."""
    frames = choose_frames(model)
    n, lanes = len(model), format_.lanes
    body_constants = np.empty((n, BODY_CONSTANTS))
    body_constants[:, 0], body_constants[:, 1] = np.cos(frames.about_x), np.sin(frames.about_x)
    body_constants[:, 2:5] = frames.places
    body_constants[:, 5] = model.masses
    body_constants[:, 6:9] = np.einsum("nji,nj->ni", frames.user, model.masses[:, None] * model.coms)
    inertia = transpose(frames.user) @ model.origin_inertias @ frames.user
    body_constants[:, 9:15] = inertia[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    body_constants[:, 15] = frames.angle
    body_constants[:, 17] = frames.kinds == PRISMATIC
    body_constants[:, 16] = 1.0 - body_constants[:, 17]
    body_constants[:, ARMATURE:] = 0.0
    for group in model.groups:
        body_constants[group.bodies, ARMATURE : ARMATURE + group.joint.nv] = model.armature[group.v_columns]
    frame_constants = np.empty((n, FRAME_CONSTANTS))
    frame_constants[:, :9] = frames.user.reshape(n, 9)
    frame_constants[:, 9:18] = frames.general.reshape(n, 9)
    frame_constants[:, 18], frame_constants[:, 19] = np.cos(frames.fork), np.sin(frames.fork)
    frame_constants[:, 20], frame_constants[:, 21] = np.cos(frames.angle), np.sin(frames.angle)
    topology, vectors = _lay_out(model, frames, 12 if bodies else 9, lanes, forward_dynamics)
    scratch = vectors * lanes + CACHE_LINE // format_.dtype.itemsize
    return ModelTables(body_constants.astype(format_.dtype), frame_constants.astype(format_.dtype), topology, scratch)


def _lay_out(
    model: Model, frames: AxisFrames, motion: int, lanes: int, forward_dynamics: bool
) -> tuple[NDArray[np.int64], int]:
    """Give everything its place in the scratch memory; returns the table and how many vectors there are."""
    n, parents = len(model), model.parents
    ground = _RINGS * 2 * lanes
    apart = parents != np.arange(n) - 1
    kept = np.zeros(n, dtype=bool)
    kept[parents[apart & (parents >= 0)]] = True
    single, prismatic = frames.kinds < PLANAR, frames.kinds == PRISMATIC
    gain, inertia = (GAIN, INERTIA) if forward_dynamics else (0, 0)
    # Where nothing lies behind a wrench, what forward dynamics leaves of the joint may go over it: it comes later.
    poses = np.where(single, 8 + prismatic, 18)
    gains_at = np.where(single & ~prismatic, 2, poses)
    others = motion + inertia
    sizes = np.maximum(poses, gains_at + gain * np.diff(model.v_starts)) + np.where(kept, others, 0)
    ends = ground + others + _WRENCH + np.cumsum(sizes)
    starts = ends - sizes
    table = np.empty((n, TOPOLOGY), dtype=np.int64)
    table[:, KIND] = frames.kinds
    table[:, Q_COLUMN], table[:, V_COLUMN] = model.q_starts[:-1], model.v_starts[:-1]
    table[:, SLOT] = starts * lanes
    table[:, FORCE] = (starts + np.where(single, 2, 12)) * lanes
    table[:, GAINS] = (starts + gains_at) * lanes
    keep = (ends - others) * lanes
    table[:, KEEP] = np.where(kept, keep, -1)
    rooted = parents < 0
    table[:, FROM] = np.where(apart, np.where(rooted, ground * lanes, keep[parents]), -1)
    table[:, RETURN] = np.where(rooted, (ground + others) * lanes, table[parents, FORCE])
    table[:, FORK] = frames.fork != 0
    return table, int(ends[-1])


def lay_out_screws(length: int, format_: NumberFormat, *, bodies: bool) -> tuple[NDArray[np.int64], int]:
    """Topology of a block of screws, of which each lane has its own, and the numbers of scratch memory it needs."""
    lanes, motion = format_.lanes, 12 if bodies else 9
    root = _RINGS * 2 * lanes + motion
    order = np.arange(length)
    table = np.full((length, TOPOLOGY), -1, dtype=np.int64)
    table[:, KIND], table[:, Q_COLUMN], table[:, V_COLUMN] = SCREW, order, order
    table[:, SLOT] = (root + _WRENCH + 9 * order) * lanes
    table[:, FORCE] = table[:, SLOT] + 2 * lanes
    table[:, RETURN] = root * lanes
    table[:, FORK] = order == 0
    return table, (root + _WRENCH + 9 * length) * lanes + CACHE_LINE // format_.dtype.itemsize


def _upright(axes: Array) -> Array:
    """Rotations ``(k, 3, 3)`` that take z to unit axes ``(k, 3)``."""
    helper = np.where(np.abs(axes[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    # An axis along z keeps its frame, so that the common case stays readable and exact.
    x = helper - np.sum(helper * axes, axis=1, keepdims=True) * axes
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack((x, np.cross(axes, x), axes), axis=2)


def _about_z(angle: Array) -> Array:
    out = np.zeros((*angle.shape, 3, 3))
    out[..., 0, 0] = out[..., 1, 1] = np.cos(angle)
    out[..., 1, 0] = np.sin(angle)
    out[..., 0, 1] = -out[..., 1, 0]
    out[..., 2, 2] = 1.0
    return out


def _turns(rotation: Array) -> tuple[Array, Array, Array]:
    """Angles about z, x and z that make a rotation, each exact to rounding even where they are not unique."""
    straight = np.hypot(rotation[:, 0, 2], rotation[:, 1, 2]) < 1e-15
    first = np.where(straight, 0.0, np.arctan2(rotation[:, 0, 2], -rotation[:, 1, 2]))
    # The other two from what is left, so that an error of the first does not go into their sum.
    rest = transpose(_about_z(first)) @ rotation
    return first, np.arctan2(-rest[:, 1, 2], rest[:, 2, 2]), np.arctan2(-rest[:, 0, 1], rest[:, 0, 0])
