"""What consecutive bodies of a serial chain amount to together: one relative motion and one composite inertia."""

from mp2a import kernels
from mp2a.algebra import inertia, motion
from mp2a.joint_kinematics import joint_motion
from mp2a.kernels import batch, long
from mp2a.model import Model
from mp2a.spatial import Array
from mp2a.validation import JointState


def reduce_block(
    model: Model, state: JointState, *, loaded: bool, threads: int | None = None
) -> tuple[Array, Array | None]:
    """Put the bodies of a serial chain together.

    Parameters
    ----------
    model, state, threads
        As `mp2a.serial.rnea.rnea` takes them, with numbers that were checked.
    loaded
        Whether the composite inertia is asked for, not the relative motion alone.

    Returns
    -------
    path
        From what the chain hangs on to its last body, ``(T, 24)``, as `mp2a.algebra.motion` has it.
    load
        About what the chain hangs on, ``(T, 28)``, as `mp2a.algebra.inertia` has it; None if it is not asked for.
    """
    reduce = long.reduce_block if long.fits(model, state.samples) else batch.reduce_block
    result = reduce(model, state, inertia=loaded, threads=threads)
    if result is not None and result.valid:
        return result.path, result.inertia
    return reduce_block_numpy(model, state)


def reduce_block_numpy(model: Model, state: JointState) -> tuple[Array, Array]:
    """Do what `reduce_block` does, with the composite inertia."""
    paths = motion.from_joint(joint_motion(model, state))
    loads = inertia.from_body(model.masses, model.coms, model.origin_inertias, state.external, state.samples)
    whole, below = paths[0], kernels.transform(loads[-1], paths[-1])
    for path in paths[1:]:
        whole = kernels.compose(whole, path)
    for path, own in zip(paths[-2::-1], loads[-2::-1], strict=True):
        below = kernels.transform(below + own, path)
    return whole, below
