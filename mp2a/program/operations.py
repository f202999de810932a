"""What a node works out between its rounds: functions of arrays ``(nodes, T, numbers)`` that can be recorded as well.

An operation gets arrays and returns arrays. Given a `Value` it notes itself down with the recorder the value is of, and
returns the values its results will have. `NOTHING` stands for a message that did not come; an operation that has a
neutral input passes the other one on.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mp2a import kernels
from mp2a.algebra import affine, motion
from mp2a.spatial import (
    Array,
    apply,
    force_to_child,
    motion_operator,
    spatial_to_classical,
    transpose,
    velocity_product,
)

if TYPE_CHECKING:
    from mp2a.program.recorder import MethodRecorder


class Nothing:
    """The type of `NOTHING`."""

    def __repr__(self) -> str:
        return "NOTHING"


NOTHING = Nothing()
"""What an exchange brings to a node that no message came to."""


class Value:
    """A symbol in the place of an array ``(1, T, width)``, while a method is recorded."""

    __slots__ = ("number", "recorder", "width")

    def __init__(self, recorder: "MethodRecorder", number: int, width: int) -> None:
        self.recorder = recorder
        self.number = number
        self.width = width


class Operation:
    """A function on arrays that can be recorded.

    Parameters
    ----------
    function
        What it does.
    widths
        Numbers a sample of each result; of none: as many as the first input has.
    step
        Name of its compiled form in `mp2a.kernels.STEPS`, if it has one.
    neutral
        For inputs that may be `NOTHING`: which input is the result then.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        *widths: int,
        step: str | None = None,
        neutral: Mapping[int, int] | None = None,
    ) -> None:
        self.function = function
        self.widths = widths
        self.step = step
        self._neutral = tuple((neutral or {}).items())

    def __call__(self, *inputs: Any) -> Any:
        """Work it out, or note it down."""
        for place, result in self._neutral:
            if inputs[place] is NOTHING:
                return inputs[result]
        for given in inputs:
            if isinstance(given, Value):
                return given.recorder.note(self, inputs)
        return self.function(*inputs)

    def __repr__(self) -> str:
        return f"<operation {self.function.__name__}>"


def _motion_operator(path: Array) -> Array:
    across = motion.view(path)
    return motion_operator(across.rotation, across.translation).reshape(*path.shape[:-1], 36)


def _velocity_across(path: Array) -> Array:
    return motion.view(path).velocity.copy()


def _acceleration_across(path: Array, velocity: Array) -> Array:
    r, p, relative, rate = motion.view(path)
    return rate + velocity_product(p, r, velocity - relative, relative, velocity)


def _transpose(matrix: Array) -> Array:
    square = matrix.reshape(*matrix.shape[:-1], 6, 6)
    return np.ascontiguousarray(transpose(square)).reshape(matrix.shape)


def _apply(matrix: Array, vector: Array) -> Array:
    return apply(matrix.reshape(*matrix.shape[:-1], 6, 6), np.broadcast_to(vector, (*matrix.shape[:-1], 6)))


def _from_parent(path: Array, force: Array) -> Array:
    across = motion.view(path)
    return force_to_child(across.rotation, across.translation, force)


add = Operation(np.add, step="add", neutral={0: 1, 1: 0})
"""``a + b``"""

product = Operation(affine.product, 36, step="product", neutral={0: 1, 1: 0})
"""``C₂ C₁`` of matrices in rows of 36: `mp2a.algebra.affine.product`."""

push = Operation(affine.push, 6, step="push", neutral={1: 2})
"""``C x + b``: `mp2a.algebra.affine.push`."""

subtract = Operation(np.subtract, step="subtract", neutral={1: 0})
"""``a - b``"""

apply_matrix = Operation(_apply, 6, step="apply_matrix", neutral={1: 1})
"""``C x`` with the matrix in rows of 36."""

transpose_matrix = Operation(_transpose, 36, step="transpose_matrix")
"""``Cᵀ`` of matrices in rows of 36."""

compose = Operation(kernels.compose, 24, step="compose", neutral={0: 1, 1: 0})
"""Put a path above another one: `mp2a.algebra.motion.compose`."""

transform = Operation(kernels.transform, 28, step="transform")
"""Carry a composite inertia across a path: `mp2a.algebra.inertia.transform`."""

transform_force = Operation(kernels.transform_force, 6, step="transform_force")
"""Take a force from the lower to the upper end of a path: `mp2a.spatial.force_to_parent`."""

force_from_parent = Operation(_from_parent, 6, step="force_from_parent", neutral={1: 1})
"""Take a force from the upper to the lower end of a path: `mp2a.spatial.force_to_child`."""

force_of = Operation(kernels.force, 6, step="force", neutral={0: 0})
"""Force that a composite inertia takes for a motion of its body: `mp2a.algebra.inertia.force`."""

acceleration_from_base = Operation(motion.acceleration_from_base, 6, step="acceleration_from_base")
"""Spatial acceleration of a body whose path reaches the base, in a field of gravity:
`mp2a.algebra.motion.acceleration_from_base`."""

to_classical = Operation(spatial_to_classical, 6, step="to_classical")
"""Classical acceleration of a spatial one and a velocity: `mp2a.spatial.spatial_to_classical`."""

operator_across = Operation(_motion_operator, 36, step="operator_across")
"""``Pᵀ Rᵀ`` across a path, in rows of 36: `mp2a.spatial.motion_operator`."""

velocity_across = Operation(_velocity_across, 6, step="velocity_across")
"""Velocity of a path's lower end relative to its upper one: ``H q̇`` of a joint, the body's own if the path reaches the
base."""

acceleration_across = Operation(_acceleration_across, 6, step="acceleration_across")
"""``H q̈`` and the velocity products of a path whose lower end has a velocity: `mp2a.spatial.velocity_product`."""
