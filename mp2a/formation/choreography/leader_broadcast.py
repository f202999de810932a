"""How the leaders' motion reaches the robots: through the chain, by the same scan as all else in the library.

Only the process of the first robot works the virtual leaders out. Body i of the chain is robot i's place, its joint the
place seen from that of the robot before, so only the first joint moves; what moves it comes to all robots as pose and
velocity of their own bodies. Each virtual leader has a sample of the scan, in which every robot is where it would be
behind that leader. In as many samples more every leader's step in the program travels, as a coordinate of bodies
without a place: all know the scenario, and read off there what comes next.

While a formation changes, places are those of the tick before until the scan has told that there are new ones. They
cancel when a robot goes back from its place to its leader, so what it learns is of this tick.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.exceptions import InputError
from mp2a.formation import plane
from mp2a.formation.choreography.leader import Leaders
from mp2a.formation.choreography.program import MEET, SHAPE, Program
from mp2a.formation.exchange import Exchange
from mp2a.formation.plane import Motion, at_rest, beyond
from mp2a.model import Model
from mp2a.spatial import Array


class Parts(NamedTuple):
    """Who has which leader, and which places the program has.

    Attributes
    ----------
    leader
        ``(n,)``: number of each robot's leader, from 0 to L - 1. Robots with the same steps have one leader for good.
    first
        ``(L,)``: a robot of each leader.
    places
        ``(n, steps, 2)``: each robot's place while its leader is at a step, m.
    """

    leader: NDArray[np.intp]
    first: NDArray[np.intp]
    places: Array


def parts(program: Program) -> Parts:
    """Look through a program once, before it is told."""
    shapes = (program.kind == SHAPE) | (program.kind == MEET)
    steps = np.concatenate((program.kind[..., None], program.meeting[..., None]), axis=-1)
    moves = np.where(shapes[..., None], 0.0, program.values)
    rows = np.concatenate((steps, moves), axis=-1).reshape(len(program), -1)
    _, first, leader = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    # A place holds from the step after its own; what the first step says holds from the start.
    newest = np.maximum.accumulate(np.where(shapes, np.arange(program.kind.shape[1]), 0), axis=1)
    before = np.column_stack((np.zeros(len(program), dtype=np.intp), newest[:, :-1]))
    places = np.take_along_axis(program.values[..., :2], before[..., None], axis=1)
    return Parts(leader.reshape(-1), first, places)


def planar_chain(n: int) -> Model:
    """Model of n bodies of 1 kg with planar joints; motion does not depend on the masses."""
    return Model.uniform(n, joint="planar", offset=(0.0, 0.0, 0.0), inertia=np.eye(3))


def tell(
    exchange: Exchange, parts: Parts, before: Leaders, course: Leaders | None, wrong: InputError | None = None
) -> Leaders:
    """Take the leaders' motion from the first robot to all others; collective.

    Parameters
    ----------
    exchange
        Over `planar_chain`.
    parts
        Of the program.
    before
        What all were told a tick ago.
    course
        Of this tick, in the process of the first robot; None in others, and not looked at there.
    wrong
        An error found here that every process is to raise.

    Returns
    -------
    Leaders
        Of all n robots; poses and twists are what the scan says where the robots of this process are.

    Raises
    ------
    InputError
        In every process, if there is one in any.
    """
    here = exchange.robots
    many, m = len(parts.first), len(here)
    links = np.diff(before.place, axis=0, prepend=0.0)[here]
    joints = at_rest(np.zeros((2 * many, m, 3)))
    joints.pose[:many, :, :2] = links
    if here[0] == 0 and course is not None:
        leaders = at_rest(course.pose[parts.first])
        leaders.velocity[:, [0, 2]] = course.twist[parts.first]
        first = beyond(leaders, at_rest(np.append(before.place[0], 0.0)))
        joints.pose[:many, 0], joints.velocity[:many, 0] = first.pose, first.velocity
        joints.pose[many:, 0, 0] = course.step[parts.first]
    found = exchange.run(joints, np.zeros_like(joints.pose), wrong).motion

    n = len(parts.leader)
    body = np.zeros(n, dtype=np.intp)  # of robots elsewhere: what any robot here can tell
    body[here] = np.arange(m)
    place = at_rest(np.column_stack((before.place[here[body]], np.zeros(n))))
    seen = plane.before(Motion(*(x[parts.leader, body] for x in found)), place)
    step = np.rint(found.pose[many + parts.leader, body, 0]).astype(np.intp)
    return Leaders(
        pose=seen.pose,
        twist=seen.velocity[:, [0, 2]],
        step=step,
        place=parts.places[np.arange(n), step],
    )
