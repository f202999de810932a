r"""What bodies further out press on a body with, whatever that body does: the segment "sweep" scans inwards.

For any velocity V = [ω; v] and spatial acceleration A of the body, the bodies of the segment, which move relative to it
in a known way, together take the force

.. math:: F = I A + p + \begin{bmatrix} \dot J \omega + \omega \times L \\ 2\, \omega \times P \end{bmatrix}
          + V \times^* I V

I is their composite inertia (mass m, first moment h, rotational inertia J about the origin), p what their relative
motion and outer forces take. The middle term is the B of the derivation (theory, section 4), which is 6×6 but has 12
numbers: the rate :math:`\dot J` of the composite inertia (symmetric, 6), and the momenta L (3) and P (3) of the
relative motion. A segment is 28 numbers a sample, ``(..., 28)``: m, h (3), J (6), p (6), J̇ (6), L (3), P (3). Segments
about the same origin add up.
"""

from typing import NamedTuple

import numpy as np

from mp2a.algebra import motion
from mp2a.spatial import Array, apply, cross, force_to_parent, skew, transpose

DOUBLES = 28

IDENTITY = np.zeros(DOUBLES)
"""No body at all."""
IDENTITY.flags.writeable = False

_UPPER = np.array([0, 1, 2, 4, 5, 8])
"""Places of the six numbers of a symmetric 3x3 matrix in its nine."""
_FULL = np.array([0, 1, 2, 1, 3, 4, 2, 4, 5])
"""The six numbers' places in the nine of the matrix."""


class CompositeInertia(NamedTuple):
    """Parts of a segment ``(..., 28)``, about one origin; the matrices are copies, the rest views."""

    mass: Array
    """m, ``(...,)``, kg"""
    moment: Array
    """h, mass times centre of mass, ``(..., 3)``, kg m"""
    inertia: Array
    """J, ``(..., 3, 3)``, kg m²"""
    force: Array
    """p, ``(..., 6)``, N m and N"""
    inertia_rate: Array
    """J̇, ``(..., 3, 3)``, kg m²/s"""
    angular: Array
    """L, ``(..., 3)``, kg m²/s"""
    linear: Array
    """P, ``(..., 3)``, kg m/s"""


def view(segment: Array) -> CompositeInertia:
    """Name the parts of a segment."""
    return CompositeInertia(
        segment[..., 0],
        segment[..., 1:4],
        _matrix(segment[..., 4:10]),
        segment[..., 10:16],
        _matrix(segment[..., 16:22]),
        segment[..., 22:25],
        segment[..., 25:28],
    )


def from_body(mass: Array, com: Array, inertia: Array, external: Array | None, samples: int) -> Array:
    """Segments of single bodies, ``(n, T, 28)``: their inertia, less what pushes them.

    Parameters
    ----------
    mass, com, inertia
        ``(n,)``, ``(n, 3)`` and, about the origin, ``(n, 3, 3)``.
    external
        Forces on the bodies ``(n, T or 1, 6)``, or None.
    samples
        T.
    """
    out = np.zeros((len(mass), samples, DOUBLES))
    out[..., 0] = mass[:, None]
    out[..., 1:4] = (mass[:, None] * com)[:, None]
    out[..., 4:10] = _symmetric(inertia)[:, None]
    if external is not None:
        out[..., 10:16] = -external
    return out


def force(segment: Array, velocity: Array, acceleration: Array) -> Array:
    """Force that the segment takes for a motion of its body, ``(..., 6)``.

    Parameters
    ----------
    segment
        ``(..., 28)``
    velocity, acceleration
        V and the *spatial* acceleration A of the body, ``(..., 6)``.
    """
    return _force(view(segment), velocity, acceleration)


def transform(segment: Array, path: Array) -> Array:
    """Carry segments across paths, to the bodies at the paths' upper ends.

    Parameters
    ----------
    segment
        ``(..., 28)`` about the lower body's origin.
    path
        ``(..., 24)``, see `mp2a.algebra.motion`.
    """
    load, across = view(segment), motion.view(path)
    w, v = across.velocity[..., :3], across.velocity[..., 3:]
    m, h, j = load.mass[..., None], load.moment, load.inertia
    # The path's own motion joins the relative motion of the segment's bodies, in the lower frame …
    linear = load.linear + m * v + cross(w, h)
    angular = load.angular + apply(j, w) + cross(h, v)
    w_skew, h_skew, v_skew = skew(w), skew(h), skew(v)
    half = w_skew @ j - h_skew @ v_skew
    rate = load.inertia_rate + half + transpose(half)
    taken = _force(load, across.velocity, across.acceleration)
    # … and all of it goes to the upper frame and origin.
    r, p = across.rotation, across.translation
    h, linear, angular = apply(r, h), apply(r, linear), apply(r, angular)
    p_skew = skew(p)
    out = np.empty((*np.broadcast_shapes(segment.shape[:-1], path.shape[:-1]), DOUBLES))
    out[..., 0] = load.mass
    out[..., 1:4] = m * p + h
    out[..., 4:10] = _symmetric(_turned(r, j) - _twice(p_skew @ (skew(h) + 0.5 * m[..., None] * p_skew)))
    out[..., 10:16] = force_to_parent(r, p, taken)
    out[..., 16:22] = _symmetric(_turned(r, rate) - _twice(p_skew @ skew(linear)))
    out[..., 22:25] = angular + cross(p, linear)
    out[..., 25:28] = linear
    return out


def _force(load: CompositeInertia, velocity: Array, acceleration: Array) -> Array:
    w, v = velocity[..., :3], velocity[..., 3:]
    dw, a = acceleration[..., :3], acceleration[..., 3:]
    m, h = load.mass[..., None], load.moment
    momentum = m * v + cross(w, h)
    spin = apply(load.inertia, w) + cross(h, v)
    linear = m * a + cross(dw, h) + cross(w, momentum + 2 * load.linear) + load.force[..., 3:]
    angular = (
        apply(load.inertia, dw)
        + cross(h, a)
        + apply(load.inertia_rate, w)
        + cross(w, load.angular + spin)
        + cross(v, momentum)
        + load.force[..., :3]
    )
    return np.concatenate((angular, linear), axis=-1)


def _turned(r: Array, matrix: Array) -> Array:
    out: Array = r @ matrix @ transpose(r)
    return out


def _twice(matrix: Array) -> Array:
    """Matrix and its transpose, added up."""
    return matrix + transpose(matrix)


def _matrix(six: Array) -> Array:
    return six[..., _FULL].reshape(*six.shape[:-1], 3, 3)


def _symmetric(matrix: Array) -> Array:
    return matrix.reshape(*matrix.shape[:-2], 9)[..., _UPPER]
