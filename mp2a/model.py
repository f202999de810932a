"""The formation as a multibody: bodies, the virtual joints between them, and who hangs on whom."""

import hashlib
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array, check_parents, check_rotations, read_only, symmetric_inertias, unit_axes
from mp2a.exceptions import InputError
from mp2a.files import atomic_write
from mp2a.joint_parameters import JOINT_PARAMETERS, check_lengths, joint_parameters
from mp2a.joints import JOINTS, JointGroup, joint_groups
from mp2a.spatial import GRAVITY, Array, inertia_at_origin

if TYPE_CHECKING:
    import pinocchio

_FORMAT = 3
_OF_BODIES = "joints", "axes", "rotations", "translations", "masses", "coms", "inertias", "names"


@dataclass(frozen=True, eq=False)
class Model:
    """Rigid bodies tied by joints; body i is robot i and hangs on body ``parents[i] < i`` (-1: the base).

    Attributes
    ----------
    parents
        ``(n,)`` integers.
    joints
        ``n`` names of `mp2a.joints.JOINTS`.
    axes
        ``(n, 3)`` unit axes of revolute, continuous and prismatic joints in the body's frame; ignored for others.
    rotations, translations
        ``(n, 3, 3)`` and ``(n, 3)`` m: the joint's frame at zero displacement, in the parent body's frame.
    masses, coms, inertias
        ``(n,)`` kg; ``(n, 3)`` m, centre of mass in the body's frame; ``(n, 3, 3)`` kg m² about the centre of mass.
    names
        ``n`` names of the joints.
    gravity
        ``(3,)`` m/s² in the base frame: the field that calls for this model take unless told another.
    armature, damping, friction, stiffness
        ``(nv,)`` each, empty for none: inertia of the drives, felt at the joints, kg m² and kg (pinocchio's); force
        against the velocity, N m s/rad and N s/m; dry friction, N m and N; springs to ``rest``, N m/rad and N/m.
    rest
        ``(nq,)``: the coordinates at which the springs do not pull; empty, or without springs: those of zero
        displacement.

    Raises
    ------
    InputError
        If a field has the wrong shape, is not finite, a rotation is not one, an axis is zero, a mass or a number of
        a joint is negative, an inertia is not symmetric or has a negative moment, a joint type is unknown or a parent
        does not come before its child. (A moment larger than the other two together is let through.)
    """

    parents: NDArray[np.intp]
    joints: tuple[str, ...]
    axes: Array
    rotations: Array
    translations: Array
    masses: Array
    coms: Array
    inertias: Array
    names: tuple[str, ...] = ()
    gravity: Array = field(default_factory=lambda: np.array(GRAVITY))
    armature: Array = field(default_factory=lambda: np.empty(0))
    damping: Array = field(default_factory=lambda: np.empty(0))
    friction: Array = field(default_factory=lambda: np.empty(0))
    stiffness: Array = field(default_factory=lambda: np.empty(0))
    rest: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        parents = array("parents", self.parents, (None,), whole=True)
        n = len(parents)
        if n == 0:
            raise InputError("parents: got no body, expected at least one")
        check_parents(parents)
        joints = tuple(self.joints)
        for i, joint in enumerate(joints):
            if joint not in JOINTS:
                raise InputError(f"joints: got {joint!r} for body {i}, expected one of {', '.join(JOINTS)}")
        names = tuple(self.names) or tuple(f"joint{i + 1}" for i in range(n))
        for label, words in (("joints", joints), ("names", names)):
            if len(words) != n:
                raise InputError(f"{label}: got {len(words)}, expected {n}, one a body")
        arrays = {
            "axes": array("axes", self.axes, (n, 3)),
            "rotations": array("rotations", self.rotations, (n, 3, 3)),
            "translations": array("translations", self.translations, (n, 3)),
            "masses": array("masses", self.masses, (n,)),
            "coms": array("coms", self.coms, (n, 3)),
            "inertias": array("inertias", self.inertias, (n, 3, 3)),
            "gravity": array("gravity", self.gravity, (3,)),
            **joint_parameters(joints, {name: getattr(self, name) for name in JOINT_PARAMETERS}),
        }
        axial = np.array([JOINTS[joint].axial for joint in joints])
        arrays["axes"] = unit_axes(arrays["axes"], axial)
        check_rotations(arrays["rotations"])
        if (arrays["masses"] < 0).any():
            i = int(np.argmax(arrays["masses"] < 0))
            raise InputError(f"masses: got {arrays['masses'][i]} for body {i}, expected no negative mass")
        arrays["inertias"] = symmetric_inertias(arrays["inertias"])
        with np.errstate(over="ignore", invalid="ignore"):
            about_origins = inertia_at_origin(arrays["masses"], arrays["coms"], arrays["inertias"])
        if not np.isfinite(about_origins).all():
            i = int(np.argwhere(~np.isfinite(about_origins))[0, 0])
            raise InputError(f"coms: got {arrays['coms'][i].tolist()} for body {i}, expected a finite inertia there")
        for name, value in {"parents": parents, **arrays}.items():
            object.__setattr__(self, name, read_only(value))
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "names", names)

    # ---- reading off -------------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.parents)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self.digest() == other.digest()

    def __hash__(self) -> int:
        return hash(self.digest())

    def __reduce__(self) -> tuple[type["Model"], tuple[Any, ...]]:
        # Through the constructor, so that copies and what is unpickled cannot be written either.
        return type(self), tuple(getattr(self, part.name) for part in fields(self))

    def __repr__(self) -> str:
        kinds = ", ".join(f"{len(g.bodies)} {g.joint.name}" for g in self.groups)
        shape = "chain" if self.is_serial else "tree"
        return f"<Model of {len(self)} bodies ({shape}; {kinds}), nq={self.nq}, nv={self.nv}>"

    @cached_property
    def q_starts(self) -> NDArray[np.intp]:
        """``(n + 1,)``: body i's coordinates are ``q[q_starts[i]:q_starts[i + 1]]``."""
        return read_only(np.cumsum([0, *(JOINTS[joint].nq for joint in self.joints)], dtype=np.intp))

    @cached_property
    def v_starts(self) -> NDArray[np.intp]:
        """``(n + 1,)``: body i's velocities are ``v[v_starts[i]:v_starts[i + 1]]``."""
        return read_only(np.cumsum([0, *(JOINTS[joint].nv for joint in self.joints)], dtype=np.intp))

    @cached_property
    def nq(self) -> int:
        """The number of coordinates."""
        return int(self.q_starts[-1])

    @cached_property
    def nv(self) -> int:
        """The number of degrees of freedom."""
        return int(self.v_starts[-1])

    @cached_property
    def is_serial(self) -> bool:
        """Whether every body hangs on the one before it."""
        return bool((self.parents == np.arange(len(self)) - 1).all())

    @cached_property
    def has_joint_forces(self) -> bool:
        """Whether joints have damping, friction or springs."""
        return bool(self.damping.any() or self.friction.any() or self.stiffness.any())

    @cached_property
    def groups(self) -> tuple[JointGroup, ...]:
        """The bodies of each joint type that occurs."""
        return joint_groups(self.joints, self.axes, self.q_starts, self.v_starts)

    @cached_property
    def origin_inertias(self) -> Array:
        """The rotational inertias about the bodies' origins, ``(n, 3, 3)``, kg m²."""
        return read_only(inertia_at_origin(self.masses, self.coms, self.inertias))

    @cached_property
    def derived(self) -> dict[Hashable, Any]:
        """What others have worked out of the model, such as tables of kernels, and want to find again."""
        return {}

    @cached_property
    def neutral(self) -> Array:
        """The coordinates of zero displacement, ``(nq,)``."""
        return read_only(np.concatenate([JOINTS[joint].neutral for joint in self.joints]))

    def random_state(
        self, samples: int | None = None, seed: int = 0, body: int | None = None
    ) -> tuple[Array, Array, Array]:
        """Draw ``q``, ``v``, ``a``; velocities shrink as 1/√n, so that a long chain's tip stays within reason.

        Parameters
        ----------
        samples
            The number of samples T; None for one without a sample axis.
        seed
            The same seed gives the same state, body for body.
        body
            Only this body's part, as one robot would know it: the columns of the whole state, computed alone.

        Returns
        -------
        tuple of numpy.ndarray
            ``(T, nq)``, ``(T, nv)``, ``(T, nv)``.
        """
        from mp2a.readers.generate import random_state

        q, v, a = random_state(self.joints, body, 1 if samples is None else samples, seed)
        return (q, v, a) if samples is not None else (q[0], v[0], a[0])

    def body(self, i: int) -> "Model":
        """Return body i alone, as a chain of one: all that robot i has to know."""
        if not 0 <= i < len(self):
            raise InputError(f"i: got {i}, expected a body from 0 to {len(self) - 1}")
        return self._part(slice(i, i + 1))

    def block(self, bodies: range) -> "Model":
        """Return consecutive bodies, of which each hangs on the one before, as a chain of their own.

        Raises
        ------
        InputError
            If there are none, or the model does not have them, or they are no chain.
        """
        start, stop = bodies.start, bodies.stop
        if bodies.step != 1 or not 0 <= start < stop <= len(self):
            raise InputError(f"bodies: got {bodies}, expected consecutive ones of 0 to {len(self) - 1}")
        if (self.parents[start + 1 : stop] != np.arange(start, stop - 1)).any():
            raise InputError(f"bodies: got {bodies}, which branch, expected each to hang on the one before")
        return self._part(slice(start, stop))

    def _part(self, part: slice) -> "Model":
        rates, coordinates = (slice(x[part.start], x[part.stop]) for x in (self.v_starts, self.q_starts))
        own: dict[str, Any] = {name: getattr(self, name)[part] for name in _OF_BODIES}
        own |= {name: getattr(self, name)[rates] for name in JOINT_PARAMETERS[:-1]}
        return Model(np.arange(part.stop - part.start) - 1, gravity=self.gravity, rest=self.rest[coordinates], **own)

    def digest(self) -> str:
        """Return a fingerprint of all fields: equal for equal models, on every machine."""
        sha = hashlib.sha256()
        for value in self._arrays().values():
            sha.update(f"{value.dtype.str}{value.shape}".encode() + value.tobytes())
        return sha.hexdigest()

    # ---- save and load -----------------------------------------------------------------------------------------

    def _arrays(self) -> dict[str, NDArray[Any]]:
        out = {part.name: np.asarray(getattr(self, part.name)) for part in fields(self)}
        out["parents"] = out["parents"].astype("<i8")
        return out

    def save(self, path: str | Path) -> None:
        """Write the model to an ``.npz`` file, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        with atomic_write(path) as new, new.open("wb") as file:
            np.savez_compressed(file, format=np.array(_FORMAT), **self._arrays())  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> "Model":
        """Read a model that `save` wrote; nothing in the file is executed.

        Raises
        ------
        InputError
            If the file cannot be read or holds no model.
        """
        from mp2a.readers.model_file import read_model

        data = read_model(path, _FORMAT, [part.name for part in fields(cls)])
        model = cls(**data)
        check_lengths(data, {name: getattr(model, name) for name in JOINT_PARAMETERS})
        return model

    # ---- builders and readers ----------------------------------------------------------------------------------

    @classmethod
    def uniform(
        cls,
        n: int,
        joint: str = "revolute",
        axis: ArrayLike = (0.0, 0.0, 1.0),
        offset: ArrayLike = (1.0, 0.0, 0.0),
        mass: float = 1.0,
        inertia: ArrayLike | None = None,
    ) -> "Model":
        """Make n equal bodies, each ``offset`` (m) from the last, with the centre of mass half way along.

        Parameters
        ----------
        n
            The number of bodies.
        joint, axis
            The type and axis of every joint.
        offset
            The position of body i + 1 in body i, ``(3,)`` m.
        mass
            The mass of each body, kg.
        inertia
            ``(3, 3)`` kg m² about the centre of mass; None: a slender rod along ``offset``, thickened a little.
        """
        from mp2a.readers.generate import uniform

        return cls(**uniform(n, joint, axis, offset, mass, inertia))

    @classmethod
    def random(cls, n: int, seed: int = 0, joints: Sequence[str] = ("revolute",), branching: int = 1) -> "Model":
        """Make n different bodies at random placements, with joint types drawn from ``joints``.

        Parameters
        ----------
        n
            The number of bodies.
        seed
            The same seed gives the same model.
        joints
            The types to draw from; ``tuple(mp2a.JOINTS)`` for all.
        branching
            A body hangs on one of the ``branching`` bodies before it: 1 gives a chain, more a tree.
        """
        from mp2a.readers.generate import random

        return cls(**random(n, seed, joints, branching))

    @classmethod
    def from_dh(
        cls,
        rows: ArrayLike,
        joints: Sequence[str] | None = None,
        *,
        convention: str = "standard",
        masses: ArrayLike | None = None,
        coms: ArrayLike | None = None,
        inertias: ArrayLike | None = None,
    ) -> "Model":
        """Make the model of Denavit-Hartenberg rows ``(a, alpha, d, theta)`` in m and rad, one a body.

        Parameters
        ----------
        rows
            ``(n, 4)``. The joint coordinate adds to theta (revolute) or d (prismatic).
        joints
            ``n`` of "revolute" or "prismatic"; None: all revolute.
        convention
            "standard" (Denavit and Hartenberg 1955) or "modified" (Craig 1986).
        masses, coms, inertias
            ``(n,)`` kg, ``(n, 3)`` m and ``(n, 3, 3)`` kg m² about the centre of mass, in the link's own DH frame
            of that convention; default 1 kg, at the frame's origin, 0.01 kg m² about each axis.
        """
        from mp2a.readers.dh import read_dh

        return cls(**read_dh(rows, joints, convention, masses, coms, inertias))

    @classmethod
    def from_urdf(cls, path: str | Path, root: str = "fixed") -> "Model":
        """Read the chain or tree of a URDF file, fixed joints merged, coordinates in pinocchio's order.

        Parameters
        ----------
        path
            The file. Its collision and visual shapes, limits, transmissions and mimicked joints do not count.
        root
            How the root link stands in the world: "fixed", which leaves its mass out, or by a first joint
            ``root_joint`` of type "free" (a free-flyer), "planar" or "spherical".

        Raises
        ------
        InputError
            If the file cannot be read, a number in it is missing or no number, or a joint type is unknown.
        """
        from mp2a.readers.urdf import read_urdf

        return cls(**read_urdf(path, root))

    @classmethod
    def from_pinocchio(cls, model: "pinocchio.Model") -> "Model":
        """Convert a `pinocchio.Model`, its joint order, coordinates, gravity, armature, damping and dry friction.

        Friction counts where its limits are the same both ways; others are bounds for pinocchio's solvers.

        Raises
        ------
        InputError
            If the model has a joint type mp2a does not know, or no joint at all.
        """
        from mp2a.readers.pinocchio_model import from_model

        return cls(**from_model(model))

    def to_pinocchio(self) -> "pinocchio.Model":
        """Make a `pinocchio.Model` of this one, with the same joint order, coordinates, frames and gravity."""
        from mp2a.readers.pinocchio_model import to_model

        return to_model(self._arrays())
