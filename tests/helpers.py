"""What several test files share."""

import dataclasses
from pathlib import Path

import numpy as np

from mp2a import Model
from mp2a.joint_kinematics import joint_motion
from mp2a.joints import JOINTS
from mp2a.validation import check_state

ALL_JOINTS = tuple(JOINTS)


def relative_error(a, b):
    """Largest difference, relative to the largest number of b."""
    return np.max(np.abs(a - b), initial=0.0) / max(np.max(np.abs(b), initial=0.0), 1e-300)


def random_forest(n, seed, branching):
    """Random tree of all joint types, some of whose bodies hang on the base instead."""
    tree = Model.random(n, seed, ALL_JOINTS, branching)
    loose = np.random.default_rng(seed).random(n) < 0.2 * (branching > 1)
    return dataclasses.replace(tree, parents=np.where(loose, -1, tree.parents))


def random_load(model, samples=None, seed=0):
    """Random external forces ``(n, 6)`` or ``(T, n, 6)`` and gravity ``(3,)``."""
    rng = np.random.default_rng((seed, len(model)))
    shape = (len(model), 6) if samples is None else (samples, len(model), 6)
    return rng.normal(size=shape), rng.normal(scale=9.81, size=3)


def placements(model, q):
    """Rotation ``(n, 3, 3)`` and origin ``(n, 3)`` of every body in the base frame."""
    rest = np.zeros(model.nv)
    motion = joint_motion(model, check_state(model, q, rest, rest, None))
    rotations, origins = np.empty((len(model), 3, 3)), np.empty((len(model), 3))
    for i, parent in enumerate(model.parents):
        r, p = (rotations[parent], origins[parent]) if parent >= 0 else (np.eye(3), np.zeros(3))
        rotations[i] = r @ motion.rotation[i, 0]
        origins[i] = p + r @ motion.translation[i, 0]
    return rotations, origins


def on_top_of(first, model):
    """Model whose first body is the one of ``first`` and carries what the base of ``chain`` carried."""
    names = ("axes", "rotations", "translations", "masses", "coms", "inertias")
    arrays = {name: np.concatenate((getattr(first, name), getattr(model, name))) for name in names}
    return Model(np.append(-1, model.parents + 1), first.joints + model.joints, **arrays)


def alive(processes):
    """Those of these processes, by number, that run; one that is over may wait for its parent to notice."""
    stats = {process: Path(f"/proc/{process}/stat") for process in processes}
    return [
        process
        for process, stat in stats.items()
        if stat.exists() and stat.read_text(errors="replace").rpartition(")")[2].split()[0] not in "ZX"
    ]


def derivative(function, step):
    """Derivative at 0 of ``function(t)`` by the five-point formula, whose error is of order step⁴."""
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)
