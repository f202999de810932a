"""Models made up: uniform and random."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array, count
from mp2a.exceptions import InputError
from mp2a.joints import JOINTS
from mp2a.spatial import Array


def uniform(
    n: int, joint: str, axis: ArrayLike, offset: ArrayLike, mass: float, inertia: ArrayLike | None
) -> dict[str, Any]:
    """Return the fields for `Model.uniform`."""
    count("n", n)
    step = array("offset", offset, (3,))
    mass = float(array("mass", mass, ()))
    if inertia is None:
        length = float(step @ step)
        inertia = mass / 12 * (length * np.eye(3) - np.outer(step, step) + 0.01 * (1 + length) * np.eye(3))
    translations = np.tile(step, (n, 1))
    translations[0] = 0.0
    return {
        "parents": np.arange(n) - 1,
        "joints": (joint,) * n,
        "axes": np.tile(array("axis", axis, (3,)), (n, 1)),
        "rotations": np.tile(np.eye(3), (n, 1, 1)),
        "translations": translations,
        "masses": np.full(n, mass),
        "coms": np.tile(step / 2, (n, 1)),
        "inertias": np.tile(array("inertia", inertia, (3, 3)), (n, 1, 1)),
    }


def random(n: int, seed: int, joints: Sequence[str], branching: int) -> dict[str, Any]:
    """Return the fields for `Model.random`; 512 bodies stay within tens of metres."""
    count("n", n)
    count("seed", seed, 0)
    count("branching", branching)
    unknown = [joint for joint in joints if joint not in list(JOINTS)]
    if unknown or not joints:
        raise InputError(f"joints: got {list(joints)}, expected some of {', '.join(JOINTS)}")
    rng = np.random.default_rng(seed)
    index = np.arange(n)
    axes = rng.normal(size=(n, 3))
    moments = rng.uniform(0.01, 0.02, (n, 3))  # any three such moments obey the triangle inequality of inertia
    principal = _random_rotations(rng, n)
    return {
        "parents": np.maximum(index - 1 - rng.integers(0, branching, n), np.minimum(index - 1, 0)),
        "joints": tuple(rng.choice(list(joints), n).tolist()),
        "axes": axes / np.linalg.norm(axes, axis=1, keepdims=True),
        "rotations": _random_rotations(rng, n),
        "translations": rng.normal(scale=0.2, size=(n, 3)),
        "masses": rng.uniform(0.5, 2.0, n),
        "coms": rng.normal(scale=0.1, size=(n, 3)),
        "inertias": principal @ (moments[:, :, None] * principal.swapaxes(1, 2)),
    }


def random_state(joints: Sequence[str], body: int | None, samples: int, seed: int) -> tuple[Array, Array, Array]:
    """Do what `Model.random_state` says, always with a sample axis."""
    count("seed", seed, 0)
    parts = []
    for i in range(len(joints)) if body is None else (body,):
        rng = np.random.default_rng((seed, i))
        joint = JOINTS[joints[i]]
        q = rng.uniform(-np.pi, np.pi, (samples, joint.nq))
        if joint.unit is not None:
            direction = rng.normal(size=q[:, joint.unit].shape)
            q[:, joint.unit] = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        parts.append((q, *(rng.normal(size=(2, samples, joint.nv)) / np.sqrt(len(joints)))))
    q, v, a = (np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True))
    return q, v, a


def _random_rotations(rng: np.random.Generator, n: int) -> Array:
    q, r = np.linalg.qr(rng.normal(size=(n, 3, 3)))
    q = q * np.sign(np.diagonal(r, axis1=1, axis2=2))[:, None, :]
    q[:, :, 0] *= np.linalg.det(q)[:, None]
    return q
