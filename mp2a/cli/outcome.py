"""The summary at the end of ``mp2a march`` and ``mp2a drive``: one table, and a line for each robot that failed."""

from collections.abc import Mapping, Sequence

from mp2a import tables
from mp2a.formation.outcome import Outcome


def show_outcomes(
    outcomes: Sequence[Outcome], title: str, columns: Mapping[str, Sequence[float]] | None = None
) -> None:
    """Print how a run ended for every robot.

    Parameters
    ----------
    outcomes
        One a robot.
    title
        What stands above the table.
    columns
        Further columns by heading, a number a robot.
    """
    more = columns or {}
    figures = [tables.Column(heading, lambda number: f"{number:.2f}") for heading in ("off, m", *more)]
    words = (tables.Column("robot", left=True), tables.Column("arrived", left=True))
    touched = tables.Column("touched", left=True)
    rows = [
        (
            each.role,
            "yes" if each.arrived else "no",
            None if each.distance != each.distance else each.distance,
            *(numbers[i] for numbers in more.values()),
            ", ".join(each.touched) or None,
        )
        for i, each in enumerate(outcomes)
    ]
    tables.show([tables.Table(title, (*words, *figures, touched), rows)])
    for each in outcomes:
        if not each.good:
            print(each)
