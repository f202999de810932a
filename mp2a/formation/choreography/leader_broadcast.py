"""How the leaders' motion reaches the robots: through the chain, by the same scan as all else in the library.

Only the process of the first robot works the virtual leaders out. It tells all the step of the program that each is at,
a broadcast along the chain; all know the scenario, and with the step every robot's slot. Then body i of the chain is
robot i's slot, its joint the slot seen from that of the robot before, so only the first joint moves. What moves it
comes to all robots as pose and velocity of their own bodies. Each virtual leader has a sample of the scan, in which
every robot is where it would be behind that leader.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.choreography.leader import Leaders
from mp2a.formation.choreography.program import MEET, SHAPE, LeaderProgram
from mp2a.formation.exchange import Broadcast, Exchange
from mp2a.model import Model
from mp2a.se2 import PlanarMotion
from mp2a.spatial import Array


class SharedLeaders(NamedTuple):
    """Who has which leader, and which slots the program has."""

    leader: NDArray[np.intp]
    """``(n,)``: number of each robot's leader, from 0 to L - 1. Robots with the same steps have one leader for good."""
    first: NDArray[np.intp]
    """``(L,)``: a robot of each leader."""
    slots: Array
    """``(n, steps, 2)``: each robot's slot while its leader is at a step, m."""


def shared_leaders(program: LeaderProgram) -> SharedLeaders:
    """Look through a program once, before its leaders move."""
    shapes = (program.kind == SHAPE) | (program.kind == MEET)
    steps = np.concatenate((program.kind[..., None], program.meeting[..., None]), axis=-1)
    moves = np.where(shapes[..., None], 0.0, program.values)
    rows = np.concatenate((steps, moves), axis=-1).reshape(len(program), -1)
    _, first, leader = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    # A slot holds from the step after its own; what the first step says holds from the start.
    newest = np.maximum.accumulate(np.where(shapes, np.arange(program.kind.shape[1]), 0), axis=1)
    before = np.column_stack((np.zeros(len(program), dtype=np.intp), newest[:, :-1]))
    slots = np.take_along_axis(program.values[..., :2], before[..., None], axis=1)
    return SharedLeaders(leader.reshape(-1), first, slots)


def planar_chain(n: int) -> Model:
    """Return the model of n bodies of 1 kg with planar joints; motion does not depend on the masses."""
    return Model.uniform(n, joint="planar", offset=(0.0, 0.0, 0.0), inertia=np.eye(3))


def broadcast_leaders(
    exchange: Exchange, shared: SharedLeaders, leaders: Leaders | None, broadcast: Broadcast | None = None
) -> Leaders:
    """Take the leaders' motion from the first robot to all others; collective.

    Parameters
    ----------
    exchange
        Over `planar_chain`.
    shared
        Of the program.
    leaders
        At this tick, in the process of the first robot; None in others.
    broadcast
        What tells the steps. None: the exchange's own.

    Returns
    -------
    Leaders
        Of all n robots; poses and twists are what the scan says where the robots of this process are.
    """
    here, n, many = exchange.robots, len(shared.leader), len(shared.first)
    steps = np.zeros(many) if leaders is None else leaders.step[shared.first].astype(float)
    step = (broadcast or exchange.broadcast)(steps).astype(np.intp)[shared.leader]
    slot = shared.slots[np.arange(n), step]
    joints = PlanarMotion.at_rest(np.zeros((many, len(here), 3)))
    joints.pose[..., :2] = np.diff(slot, axis=0, prepend=0.0)[here]
    if leaders is not None:
        moving = PlanarMotion.at_rest(leaders.pose[shared.first])
        moving.velocity[:, [0, 2]] = leaders.twist[shared.first]
        first = moving.compose(PlanarMotion.at_rest(np.append(slot[0], 0.0)))
        joints.pose[:, 0], joints.velocity[:, 0] = first.pose, first.velocity
    motion = exchange.run(joints, np.zeros_like(joints.pose)).motion

    body = np.zeros(n, dtype=np.intp)  # of robots elsewhere: what any robot here can tell
    body[here] = np.arange(len(here))
    places = PlanarMotion.at_rest(np.column_stack((slot[here[body]], np.zeros(n))))
    seen = PlanarMotion(*(x[shared.leader, body] for x in motion)).compose(places.inverse())
    return Leaders(seen.pose, seen.velocity[:, [0, 2]], step, slot)
