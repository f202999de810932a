"""Formulas of one body in the articulated-body algorithm (Featherstone 1983), for vectors of samples.

Frames, turns, places and wrenches are those of `mp2a.kernels.steps`. A motion is angular and linear acceleration of a
body, 6 numbers; an inertia is what an acceleration of the body costs with all that hangs on it: 21 numbers, symmetric
angular (6) and linear (6) blocks, between them the block from linear acceleration to torque (9); a load is the wrench
that it takes as things are. The gains of a degree of freedom (7) are by how much each acceleration of the body slows
it, and how fast it gets without any.
"""

from typing import Any

from llvmlite import ir

from mp2a.kernels.algebra import (
    Numbers,
    add_symmetric,
    apply_transposed,
    product,
    turned,
)
from mp2a.kernels.steps import to_body, unless
from mp2a.kernels.symbols import Symbol
from mp2a.kernels.tables import GAIN

ROWS = {"revolute": (2,), "prismatic": (5,), "planar": (3, 4, 2), "spherical": (0, 1, 2), "free": (3, 4, 5, 0, 1, 2)}
"""Which of a body's six directions each degree of freedom is, in the frames of `mp2a.kernels.tables`."""

_SYMMETRIC = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
"""Place of each number of a symmetric 3x3 matrix in its six."""

_DIGITS = 8.0
"""In units of rounding: what is left of an inertia after more was taken off has no digits any more."""


# ---- the way back: inertias and loads ---------------------------------------------------------------------------


def body_inertia(inertia: Numbers, mass: Symbol, moment: Numbers, rotational: Numbers) -> tuple[Any, ...]:
    """Add a body to the inertia of what hangs on it."""
    x, y, z = moment
    b, m = inertia[6:15], inertia[15:21]
    coupling = b[0], b[1] - z, b[2] + y, b[3] + z, b[4], b[5] - x, b[6] - y, b[7] + x, b[8]
    return add_symmetric(inertia[0:6], rotational), coupling, (m[0] + mass, m[1], m[2], m[3] + mass, m[4], m[5] + mass)


def eliminate(
    rows: tuple[int, ...], invalid: Symbol, inertia: Numbers, load: Numbers, forces: Numbers, armature: Numbers
) -> tuple[Any, ...]:
    """Let a joint give way along some directions, under its own forces.

    Returns
    -------
    tuple
        What is invalid, the inertia and load that the other end of the joint feels, still in the body's frame, and for
        each direction the gains and the rest.
    """
    matrix, pressing, gains = _matrix(inertia), [*load], []
    for row, force, own in zip(rows, forces, armature, strict=True):
        along = matrix[row]
        resistance = along[row] + own
        block = range(row // 3 * 3, row // 3 * 3 + 3)
        whole = sum((matrix[k][k] for k in block[1:]), start=matrix[block[0]][block[0]])
        invalid = unless(_exceeds(resistance, whole), invalid)
        share = 1.0 / resistance
        gain = [number * share for number in along]
        rest = (force - pressing[row]) * share
        # Written so that nothing at all is left along the direction where there is no armature.
        slack = [own * number for number in gain]
        matrix = [
            [
                slack[j] if i == row else slack[i] if j == row else matrix[i][j] - gain[i] * along[j]
                for j in range(6)
            ]
            for i in range(6)
        ]  # fmt: skip
        pressing = [force - own * rest if k == row else pressing[k] + along[k] * rest for k in range(6)]
        gains += [*gain, rest]
    return invalid, _packed(matrix), tuple(pressing), tuple(gains)


def inertia_to_parent(inertia: Numbers, turn: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Inertia of a body with one degree of freedom, about its parent's origin and in its frame."""
    sine, cosine, *about_x = turn
    about_z = _turned_about_z(inertia, cosine, sine)
    return _moved(_turned_about_x(about_z, *about_x), place)


def general_inertia_to_parent(inertia: Numbers, rotation: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Inertia of a body with any rotation and place."""
    r = rotation
    transposed = r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]
    coupling = product(product(r, inertia[6:15]), transposed)
    return _moved((*turned(r, inertia[0:6]), *coupling, *turned(r, inertia[15:21])), place)


def join_inertia(inertia: Numbers, offset: Numbers) -> tuple[Numbers, ...]:
    """Inertia in the frame before the turn of `mp2a.kernels.steps.fork`."""
    return _turned_about_z(inertia, *offset)


# ---- the way out again: accelerations ---------------------------------------------------------------------------


def motion_to_body(motion: Numbers, turn: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Motion of the parent in the frame and at the origin of a body with one degree of freedom."""
    return to_body(turn, motion[0:3]), to_body(turn, _at(place, motion))


def general_motion_to_body(motion: Numbers, rotation: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Motion of the parent in the frame and at the origin of a body with any rotation and place."""
    return apply_transposed(rotation, motion[0:3]), apply_transposed(rotation, _at(place, motion))


def accelerate(rows: tuple[int, ...], motion: Numbers, gains: Numbers) -> tuple[Any, ...]:
    """Motion of a body with that of its joint, and the joint's own accelerations."""
    moving, joints = [*motion], []
    for k in range(len(rows) - 1, -1, -1):
        *gain, rest = gains[GAIN * k : GAIN * k + GAIN]
        for number, part in zip(gain, moving, strict=True):
            rest = rest - number * part
        moving[rows[k]] = moving[rows[k]] + rest
        joints.append(rest)
    return tuple(moving), tuple(joints[::-1])


# ---- parts ------------------------------------------------------------------------------------------------------


def _matrix(inertia: Numbers) -> list[list[Any]]:
    """Six rows of six."""
    a, b, m = inertia[0:6], inertia[6:15], inertia[15:21]
    upper = [[*(a[k] for k in _SYMMETRIC[i]), *b[3 * i : 3 * i + 3]] for i in range(3)]
    lower = [[b[i], b[3 + i], b[6 + i], *(m[k] for k in _SYMMETRIC[i])] for i in range(3)]
    return upper + lower


def _packed(matrix: list[list[Any]]) -> Numbers:
    angular = [matrix[i][j] for i in range(3) for j in range(i, 3)]
    coupling = [matrix[i][j] for i in range(3) for j in range(3, 6)]
    linear = [matrix[i][j] for i in range(3, 6) for j in range(i, 6)]
    return *angular, *coupling, *linear


def _turned_about_z(inertia: Numbers, c: Any, s: Any) -> Numbers:
    """Inertia after its frame was turned about z by an angle: R X Rᵀ of each block.

    Turning a 2x2 matrix leaves its trace and what is not symmetric in it as they are. What a turn does to the rest is
    the one number g, which makes six instructions of the twelve that two products with R would take.
    """
    twice = 2.0 * c
    blocks = []
    for xx, xy, xz, yy, yz, zz in (inertia[0:6], inertia[15:21]):
        g = s * (xx - yy) + twice * xy
        blocks.append((xx - s * g, c * g - xy, c * xz - s * yz, yy + s * g, s * xz + c * yz, zz))
    xx, xy, xz, yx, yy, yz, zx, zy, zz = inertia[6:15]
    g = s * (xx - yy) + c * (xy + yx)
    coupling = (
        xx - s * g, c * g - yx, c * xz - s * yz,
        c * g - xy, yy + s * g, s * xz + c * yz,
        c * zx - s * zy, s * zx + c * zy, zz,
    )  # fmt: skip
    return *blocks[0], *coupling, *blocks[1]


def _turned_about_x(inertia: Numbers, c: Any, s: Any) -> Numbers:
    """Do the same about x, which is about z with the axes renamed."""
    return _renamed(_turned_about_z(_renamed(inertia, (1, 2, 0)), c, s), (2, 0, 1))


def _renamed(inertia: Numbers, axes: tuple[int, int, int]) -> Numbers:
    """Inertia whose k-th axis is what was axis ``axes[k]``."""
    matrix = _matrix(inertia)
    order = [*axes, *(3 + axis for axis in axes)]
    return _packed([[matrix[i][j] for j in order] for i in order])


def _moved(inertia: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Inertia about an origin from which its own is seen at a place."""
    a, b, m = inertia[0:6], inertia[6:15], inertia[15:21]
    columns = [[m[k] for k in _SYMMETRIC[j]] for j in range(3)]
    # Each number of B' = B + p~ M and of A' = A - B p~ + p~ B'ᵀ, which is symmetric, is a sum of fused products.
    coupling = [[_swept(b[3 * i + j], place, columns[j], i) for j in range(3)] for i in range(3)]
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    angular = tuple(
        _swept(_swept(x, place, coupling[j], i), place, b[3 * i : 3 * i + 3], j)
        for x, (i, j) in zip(a, pairs, strict=True)
    )
    return angular, tuple(number for row in coupling for number in row), m


def _at(place: Numbers, motion: Numbers) -> Numbers:
    """Linear acceleration at a place."""
    return tuple(_swept(motion[3 + k], motion[0:3], place, k) for k in range(3))


def _swept(number: Any, place: Numbers, vector: Any, k: int) -> Any:
    """Add to a number the k-th of ``place × vector``, by two fused products."""
    i, j = (k + 1) % 3, (k + 2) % 3
    return number + place[i] * vector[j] - place[j] * vector[i]


def _exceeds(resistance: Symbol, whole: Symbol) -> Any:
    """Whether a number has digits beside one that it is the rest of, and is not zero."""
    single = resistance.value.type.element == ir.FloatType()
    bound = whole * (_DIGITS * (2.0**-23 if single else 2.0**-52))
    return resistance.builder.fcmp_ordered(">", resistance.value, bound.value)
