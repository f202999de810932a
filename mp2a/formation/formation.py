"""A formation: its shape, and the robots as bodies on virtual planar joints."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array
from mp2a.exceptions import InputError
from mp2a.formation.shapes import Layout
from mp2a.formation.shapes import layout as named
from mp2a.model import Model
from mp2a.spatial import Array


@dataclass(frozen=True)
class Formation:
    """Robots in a shape.

    Attributes
    ----------
    layout
        Who hangs on whom, and where.
    masses
        ``(n,)``, kg; with a share of what they carry.
    inertias
        About the vertical through the centre of mass, which is the robot's origin, ``(n,)``, kg m².

    Raises
    ------
    InputError
        If a mass or an inertia is negative, or the arrays have another length than the layout, or robot 0 does not lead
        or is not the only one to.
    """

    layout: Layout
    masses: Array
    inertias: Array

    def __post_init__(self) -> None:
        n = len(array("parents", self.layout.parents, (None,), whole=True))
        slots = array("slots", self.layout.slots, (n, 3))
        if (self.layout.parents[1:] < 0).any() or self.layout.parents[0] != -1:
            raise InputError(f"parents: got {self.layout.parents.tolist()}, expected -1 for robot 0 and for no other")
        if self.layout.follows and not (np.hypot(slots[1:, 0], slots[1:, 1]) > 0).all():
            raise InputError("slots: got a follower at no distance from its leader, expected a positive distance")
        for name in ("masses", "inertias"):
            values = array(name, getattr(self, name), (n,))
            if (values < 0).any():
                i = int(np.argmax(values < 0))
                raise InputError(f"{name}: got {values[i]} for robot {i}, expected none below zero")
            object.__setattr__(self, name, values)

    @classmethod
    def of(
        cls, shape: str, robots: int, spacing: float = 2.0, mass: ArrayLike = 50.0, inertia: ArrayLike = 5.0
    ) -> "Formation":
        """Put robots in one of `mp2a.formation.SHAPES`.

        Parameters
        ----------
        shape
            Name.
        robots
            How many.
        spacing
            Distance between neighbours, m.
        mass, inertia
            Of every robot or ``(n,)``, kg and kg m². A HUSKY has 50 kg.

        Raises
        ------
        InputError
            If there is no such shape, or a number is not what it has to be.
        """
        layout = named(shape, robots, spacing)
        values = []
        for name, value in (("mass", mass), ("inertia", inertia)):
            numbers = np.asarray(value)
            values.append(array(name, np.full(robots, value) if numbers.ndim == 0 else numbers, (robots,)))
        return cls(layout, *values)

    def __len__(self) -> int:
        return len(self.masses)

    @cached_property
    def model(self) -> Model:
        """The multibody: planar joints, each body's frame at its robot's centre of mass, x ahead, z up."""
        n = len(self)
        inertias = np.zeros((n, 3, 3))
        inertias[:, 2, 2] = self.inertias
        return Model(
            parents=self.layout.parents,
            joints=("planar",) * n,
            axes=np.zeros((n, 3)),
            rotations=np.tile(np.eye(3), (n, 1, 1)),
            translations=np.zeros((n, 3)),
            masses=self.masses,
            coms=np.zeros((n, 3)),
            inertias=inertias,
            names=tuple(f"robot{i + 1}" for i in range(n)),
        )

    @property
    def spacings(self) -> Array:
        """Distance of each slot from the parent, ``(n,)``, m; of the leader zero."""
        out: Array = np.hypot(self.layout.slots[:, 0], self.layout.slots[:, 1])
        return out
