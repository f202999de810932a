"""pinocchio's serial RNEA in mp2a's conventions: the O(n) reference."""

import numpy as np
from numpy.typing import ArrayLike

from mp2a.cores import available_memory
from mp2a.exceptions import DependencyError
from mp2a.model import Model
from mp2a.results import InverseDynamics, Placement
from mp2a.spatial import Array, spatial_to_classical, to_linear_first
from mp2a.validation import check_gravity, check_state

_TENSORS = 4
"""nv³ tensors of doubles in `pinocchio.Data`, zeroed and so resident (measured: 4.0 nv³ of 8 bytes at nv = 400)."""


class Reference:
    """A model in pinocchio, its memory checked before it is taken. Build it in one rank only.

    Parameters
    ----------
    model
        n bodies.

    Attributes
    ----------
    model
        The model.
    pin_model, data
        pinocchio's model and its memory, in its own conventions.

    Raises
    ------
    DependencyError
        If pinocchio's Data would not fit in the memory that is free, with the largest nv that would.
    """

    def __init__(self, model: Model) -> None:
        need_memory(model.nv)
        import pinocchio

        self.model = model
        self.pin_model: pinocchio.Model = model.to_pinocchio()
        # pinocchio.Data(model), not model.createData(), which copies the tensors once and peaks at twice the memory.
        self.data: pinocchio.Data = pinocchio.Data(self.pin_model)

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """Return torques ``(T, nv)`` alone for unchecked ``(T, …)``, as fast as pinocchio's Python loop goes."""
        import pinocchio

        rnea, pin_model, data = pinocchio.rnea, self.pin_model, self.data
        return np.array([rnea(pin_model, data, *sample) for sample in zip(q, v, a, strict=True)])

    def rnea(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        external_forces: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
    ) -> InverseDynamics:
        """Do what `mp2a.rnea` does with ``bodies=True``, by pinocchio, a sample at a time."""
        import pinocchio

        state = check_state(self.model, q, v, a, external_forces)
        self.pin_model.gravity.linear = check_gravity(self.model, gravity)
        n, samples = len(self.model), state.samples
        shape = (samples, n, 6)
        velocity, acceleration, force = np.empty(shape), np.empty(shape), np.empty(shape)
        placement = Placement(np.empty((samples, n, 3, 3)), np.empty((samples, n, 3)))
        torque = np.empty((samples, self.model.nv))
        for t in range(samples):
            arguments = (self.pin_model, self.data, state.q[t], state.v[t], state.a[t])
            if state.external is not None:
                external = to_linear_first(state.external[:, min(t, state.external.shape[1] - 1)])
                forces = pinocchio.StdVec_Force([pinocchio.Force(f) for f in (np.zeros(6), *external)])
                torque[t] = pinocchio.rnea(*arguments, forces)
            else:
                torque[t] = pinocchio.rnea(*arguments)
            pinocchio.updateGlobalPlacements(self.pin_model, self.data)
            for i in range(n):
                placement.rotation[t, i] = self.data.oMi[i + 1].rotation
                placement.translation[t, i] = self.data.oMi[i + 1].translation
                velocity[t, i] = self.data.v[i + 1].vector
                acceleration[t, i] = self.data.a_gf[i + 1].vector
                force[t, i] = self.data.f[i + 1].vector
        velocity, acceleration, force = (to_linear_first(x) for x in (velocity, acceleration, force))
        acceleration = spatial_to_classical(acceleration, velocity)
        cut = 0 if state.single else slice(None)
        placement = Placement(*(x[cut] for x in placement))
        return InverseDynamics(velocity[cut], acceleration[cut], force[cut], torque[cut], placement)


def need_memory(nv: int, copies: int = 1) -> None:
    """Raise an error where pinocchio's Data would not fit in the memory that is free.

    Parameters
    ----------
    nv
        Degrees of freedom.
    copies
        How many of it there are at a time.

    Raises
    ------
    DependencyError
        With the largest nv that would fit.
    """
    need, free = copies * data_bytes(nv), available_memory()
    if free is not None and need > free:
        fits = int((free / (8 * _TENSORS * copies)) ** (1 / 3))
        raise DependencyError(
            f"pinocchio's Data for nv = {nv} takes {need / 1e9:.1f} GB (it holds nv³ tensors) and "
            f"{free / 1e9:.1f} GB are free: up to nv = {fits} fits here"
        )


def data_bytes(nv: int) -> int:
    """Return the memory that `pinocchio.Data` takes for nv degrees of freedom, in bytes, to some per cent."""
    return 8 * _TENSORS * nv**3
