"""What several test files share."""

import dataclasses

import numpy as np

from mp2a import Chain
from mp2a.joints import JOINTS
from mp2a.leaf import check_state, joint_motion

ALL_JOINTS = tuple(JOINTS)


def relative_error(a, b):
    """Largest difference, relative to the largest number of b."""
    return np.max(np.abs(a - b), initial=0.0) / max(np.max(np.abs(b), initial=0.0), 1e-300)


def random_forest(n, seed, branching):
    """Random tree of all joint types, some of whose bodies hang on the base instead."""
    tree = Chain.random(n, seed, ALL_JOINTS, branching)
    loose = np.random.default_rng(seed).random(n) < 0.2 * (branching > 1)
    return dataclasses.replace(tree, parents=np.where(loose, -1, tree.parents))


def random_load(chain, samples=None, seed=0):
    """Random external forces ``(n, 6)`` or ``(T, n, 6)`` and gravity ``(3,)``."""
    rng = np.random.default_rng((seed, len(chain)))
    shape = (len(chain), 6) if samples is None else (samples, len(chain), 6)
    return rng.normal(size=shape), rng.normal(scale=9.81, size=3)


def placements(chain, q):
    """Rotation ``(n, 3, 3)`` and origin ``(n, 3)`` of every body in the base frame."""
    rest = np.zeros(chain.nv)
    motion = joint_motion(chain, check_state(chain, q, rest, rest, None))
    rotations, origins = np.empty((len(chain), 3, 3)), np.empty((len(chain), 3))
    for i, parent in enumerate(chain.parents):
        r, p = (rotations[parent], origins[parent]) if parent >= 0 else (np.eye(3), np.zeros(3))
        rotations[i] = r @ motion.rotation[i, 0]
        origins[i] = p + r @ motion.translation[i, 0]
    return rotations, origins


def on_top_of(first, chain):
    """Chain whose first body is the one of ``first`` and carries what the base of ``chain`` carried."""
    names = ("axes", "rotations", "translations", "masses", "coms", "inertias")
    arrays = {name: np.concatenate((getattr(first, name), getattr(chain, name))) for name in names}
    return Chain(np.append(-1, chain.parents + 1), first.joints + chain.joints, **arrays)


def derivative(function, step):
    """Derivative at 0 of ``function(t)`` by the five-point formula, whose error is of order step⁴."""
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)
