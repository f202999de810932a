"""How a run ended: what counts as arrived, what is said of who did not, and the exit status."""

import math

import pytest

from mp2a.cli.outcome import show_outcomes
from mp2a.formation.outcome import ARRIVAL_TOLERANCE, FAILED, exit_status, outcome


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"distance": 0.1, "over": True}, "R1 arrived, 0.10 m from its place"),
        ({"distance": 0.1, "over": True, "blocked": "R2"}, "R1 arrived, 0.10 m from its place"),
        (
            {"distance": 0.1, "over": True, "touched": ("R2", "a wall or an obstacle")},
            "R1 arrived, 0.10 m from its place; touched R2, a wall or an obstacle",
        ),
        ({"distance": 4.0, "over": True, "blocked": "R2"}, "R1 did not arrive, 4.00 m from its place: blocked by R2"),
        ({"distance": 4.0, "over": True}, "R1 did not arrive, 4.00 m from its place: nothing was in its way"),
        ({"distance": 0.0, "over": False}, "R1 did not arrive, 0.00 m from its place: time was up"),
        (
            {"distance": 0.0, "over": False, "blocked": "a wall"},
            "R1 did not arrive, 0.00 m from its place: time was up, blocked by a wall",
        ),
        (
            {"distance": math.nan, "over": True, "error": "its pose was lost"},
            "R1 did not arrive: in its error state, its pose was lost",
        ),
        ({"distance": math.nan, "over": True}, "R1 did not arrive: its pose is not known"),
    ],
)
def test_what_is_said(given, text):
    found = outcome("R1", **given)
    assert str(found) == text
    assert found.arrived == ("not arrive" not in text)
    assert exit_status([found]) == (0 if found.arrived and not found.touched else FAILED)


def test_one_robot_that_fails_is_enough():
    good = outcome("R1", ARRIVAL_TOLERANCE, over=True)
    assert exit_status([]) == exit_status([good, good]) == 0
    assert exit_status([good, outcome("R2", ARRIVAL_TOLERANCE + 1e-9, over=True)]) == FAILED


def test_the_table_fits_a_terminal_and_says_what_failed(capsys):
    outcomes = [
        outcome("R1", 0.1, over=True),
        outcome("R2", 3.2, over=True, blocked="a wall or an obstacle", touched=["R1", "a wall or an obstacle"]),
    ]
    show_outcomes(outcomes, "2 robots, 8.0 s", {"way, m": [7.62, 4.1], "fastest, m/s": [1.0, 0.9]})
    printed = capsys.readouterr().out
    assert "\x1b" not in printed
    lines = printed.splitlines()
    assert max(map(len, lines[:-1])) <= 80
    assert lines[-1] == str(outcomes[1])
    assert [line.split()[:5] for line in lines if line.startswith("R1")] == [["R1", "yes", "0.10", "7.62", "1.00"]]
