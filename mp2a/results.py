"""What inverse and forward dynamics return, in one process and over ranks."""

from collections.abc import Callable
from typing import Any, NamedTuple

from mp2a.spatial import Array


class Placement(NamedTuple):
    """Where bodies are in the base frame: the rotation and translation that take a body's coordinates there.

    With leading axes as those of the other results: ``(n, 3, 3)`` and ``(n, 3)`` for n bodies, T in front for samples.
    """

    rotation: Array
    """``(..., 3, 3)``: the body's to the base frame."""
    translation: Array
    """``(..., 3)``: the body's origin in the base frame, m."""


class InverseDynamics:
    """Motion and force of bodies, each in its own frame at its own origin, ``[angular; linear]``.

    From `mp2a.rnea` the arrays hold all n bodies, ``(n, 6)`` or ``(T, n, 6)``; from `mp2a.DistributedModel` the rank's
    own body, ``(6,)`` or ``(T, 6)``, or its m bodies, ``(m, 6)`` or ``(T, m, 6)``.

    Parameters
    ----------
    velocity, acceleration, force, torque, placement
        The attributes. A placement that is a function is called when the attribute is first read.

    Attributes
    ----------
    velocity
        ``V = [ω; v]``, rad/s and m/s (paper, eq. 4).
    acceleration
        ``V̇ = [ω̇; v̇]``, rad/s² and m/s² (eq. 5), with v̇ the classical acceleration of the origin. Gravity enters as an
        acceleration -g of the base, so a body at rest shows -g: what an accelerometer on it reads.
    force
        ``F = [τ; f]`` that the joint passes to the body, N m and N (eq. 6).
    torque
        ``τ = Hᵀ F``, ``(nv,)`` or ``(T, nv)``, N m and N.
    """

    __slots__ = ("_placement", "acceleration", "force", "torque", "velocity")

    def __init__(
        self,
        velocity: Array,
        acceleration: Array,
        force: Array,
        torque: Array,
        placement: Placement | Callable[[], Placement],
    ) -> None:
        self.velocity = velocity
        self.acceleration = acceleration
        self.force = force
        self.torque = torque
        self._placement = placement

    @property
    def placement(self) -> Placement:
        """The bodies' placements in the base frame, a `Placement` ``(…, 3, 3)`` and ``(…, 3)`` m.

        Where a method has no use for them itself they are worked out, for the coordinates of the call, when they are
        first asked for.
        """
        if not isinstance(self._placement, Placement):
            self._placement = self._placement()
        return self._placement

    def defer_placement(self, place: Callable[[], Placement]) -> None:
        """Forget the placement; the next to ask gets what ``place`` works out."""
        self._placement = place

    def __repr__(self) -> str:
        shapes = ", ".join(
            f"{name} {getattr(self, name).shape}" for name in ("velocity", "acceleration", "force", "torque")
        )
        return f"<{type(self).__name__}: {shapes}, placement>"

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        return InverseDynamics, (self.velocity, self.acceleration, self.force, self.torque, self.placement)


class ForwardDynamics(InverseDynamics):
    """Accelerations of the joints, and what `InverseDynamics` has, for the motion that they make.

    Attributes
    ----------
    joint_acceleration
        ``(nv,)`` or ``(T, nv)``, rad/s² and m/s².
    """

    __slots__ = ("joint_acceleration",)

    def __init__(self, motion: InverseDynamics, joint_acceleration: Array) -> None:
        super().__init__(motion.velocity, motion.acceleration, motion.force, motion.torque, motion._placement)
        self.joint_acceleration = joint_acceleration

    def __repr__(self) -> str:
        return f"{super().__repr__()[:-1]}, joint_acceleration {self.joint_acceleration.shape}>"

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        motion = InverseDynamics(self.velocity, self.acceleration, self.force, self.torque, self.placement)
        return ForwardDynamics, (motion, self.joint_acceleration)
