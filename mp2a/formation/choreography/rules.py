"""What shows on paper once the robots are known: distances, radii and speeds that do not fit them."""

import itertools
from collections.abc import Iterator

import numpy as np

from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.leader import arc_rate
from mp2a.formation.choreography.scenario import Circle, NewLeader, Scenario, Shape
from mp2a.formation.constants import LEADER_SPEED_SHARE, STOP_DISTANCE, STOP_SIDE
from mp2a.formation.robot_models import Fleet

Slots = dict[str, tuple[float, float]]


def broken_rules(scenario: Scenario, fleet: Fleet, max_speed: float, margin: float) -> list[Finding]:
    """Rules of the thesis, chapters 4 and 6, that a scenario breaks with these robots.

    Parameters
    ----------
    scenario
        What they are to do.
    fleet
        Their sizes and limits.
    max_speed
        v_max, m/s.
    margin
        What is to stay free between two bodies, m.
    """
    findings = list(_speed(scenario, fleet, max_speed))
    now: Slots = {}
    for k, instruction in enumerate(scenario.instructions):
        if isinstance(instruction, Shape):
            now |= instruction.slots()
            findings += _tight(scenario, fleet, _together(scenario, k, instruction), margin, instruction.line)
        elif isinstance(instruction, Circle):
            members = scenario.members(instruction.group)
            findings += _arc(scenario, fleet, instruction, {role: now[role] for role in members}, max_speed)
    return findings


def _together(scenario: Scenario, k: int, shape: Shape) -> list[Slots]:
    """Slots of the formation at instruction k, and those of the formations just before with the same leader."""
    after = itertools.dropwhile(lambda x: isinstance(x, Shape), scenario.instructions[k:])
    if isinstance(next(after, None), NewLeader):
        return [shape.slots()]
    before = itertools.takewhile(lambda x: isinstance(x, Shape), reversed(scenario.instructions[:k]))
    return [shape.slots(), *(other.slots() for other in before if isinstance(other, Shape))]


def _tight(scenario: Scenario, fleet: Fleet, formations: list[Slots], margin: float, line: int) -> Iterator[Finding]:
    index = {role: i for i, role in enumerate(scenario.robots)}
    roles = [role for formation in formations for role in formation]
    spots = np.array([spot for formation in formations for spot in formation.values()])
    which = [index[role] for role in roles]
    first, second = np.triu_indices(len(roles), 1)
    own = first < len(formations[0])  # pairs of two earlier formations were looked at before
    first, second = first[own], second[own]
    offset = np.abs(spots[first] - spots[second])
    sizes = fleet.sizes[which]
    gaps = offset - (sizes[first] + sizes[second]) / 2
    free = np.hypot(*np.maximum(gaps, 0.0).T)
    near = free < margin - 1e-9
    held = ~near & (gaps[:, 0] < STOP_DISTANCE) & (gaps[:, 1] < STOP_SIDE)
    for k in np.flatnonzero(near | held):
        robots = roles[first[k]], roles[second[k]]
        pair = " and ".join(robots)
        if near[k]:
            got = "their bodies overlap" if free[k] == 0 else f"{free[k]:.2f} m between their bodies"
            message = f"{pair}: {got}, expected at least {margin:.2f} m"
        else:
            rear = robots[1] if spots[second[k], 0] < spots[first[k], 0] else robots[0]
            message = (
                f"{pair}: {gaps[k, 0]:.2f} m between them, and with LIDAR the stop signal holds {rear} until there are "
                f"{STOP_DISTANCE} m"
            )
        yield Finding("spacing", message, serious=bool(near[k]), line=line, robots=robots)


def _arc(scenario: Scenario, fleet: Fleet, circle: Circle, now: Slots, max_speed: float) -> Iterator[Finding]:
    wide = max(now, key=lambda role: abs(now[role][1]))
    offset = abs(now[wide][1])
    if abs(circle.radius) <= offset:
        message = f"circle: got radius {circle.radius:g} m, expected more than the {offset:g} m of {wide} to the side"
        yield Finding("radius", message, line=circle.line, robots=(wide,))
    rate = float(arc_rate(np.array(circle.radius), np.array(circle.rate), max_speed))
    if rate < circle.rate:
        message = (
            f"circle: got {circle.rate:g} rad/s, {circle.rate * abs(circle.radius):.2f} m/s for the leader, which "
            f"drives at most {LEADER_SPEED_SHARE * max_speed:.2f}; it will turn at {rate:.3g} rad/s"
        )
        yield Finding("speed", message, serious=False, line=circle.line, robots=tuple(now))
    for role, (_, y) in now.items():
        needed = rate * abs(circle.radius - y)
        has = float(fleet.max_speed[scenario.robots.index(role)])
        if needed > has:
            message = f"circle: {role} would have to drive {needed:.2f} m/s, expected at most {has:.2f}"
            yield Finding("speed", message, line=circle.line, robots=(role,))


def _speed(scenario: Scenario, fleet: Fleet, max_speed: float) -> Iterator[Finding]:
    slowest = int(np.argmin(fleet.max_speed))
    if max_speed > fleet.max_speed[slowest]:
        role = scenario.robots[slowest]
        message = f"max_speed: got {max_speed:g} m/s, expected at most the {fleet.max_speed[slowest]:g} m/s of {role}"
        yield Finding("speed", message, robots=(role,))
