"""What every method returns."""

from dataclasses import dataclass

from mp2a.spatial import Array


@dataclass(frozen=True)
class InverseDynamics:
    """Motion and force of bodies, each in its own frame at its own origin, ``[angular; linear]``.

    From `mp2a.rnea` the arrays hold all n bodies, ``(n, 6)`` or ``(T, n, 6)``; from `mp2a.DistributedModel` this
    robot's body alone, ``(6,)`` or ``(T, 6)``.

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
    rotation, position
        Placement in the base frame, ``(n, 3, 3)`` and ``(n, 3)`` m, with T in front as above: the products X of the
        same exchanges. None from "kogge-stone", where what reaches the base goes on as a vector without its matrix,
        from "serial", and where a rank holds several bodies.
    """

    velocity: Array
    acceleration: Array
    force: Array
    torque: Array
    rotation: Array | None = None
    position: Array | None = None
