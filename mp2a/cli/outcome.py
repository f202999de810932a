"""The summary at the end of ``mp2a march`` and ``mp2a drive``: one table, and a line for each robot that failed."""

from collections.abc import Mapping, Sequence
from typing import Any

from mp2a.formation.outcome import Outcome


def show(
    outcomes: Sequence[Outcome], title: str, columns: Mapping[str, Sequence[str]] | None = None, console: Any = None
) -> None:
    """Print how a run ended for every robot.

    Parameters
    ----------
    outcomes
        One a robot.
    title
        Of the table.
    columns
        Further columns by heading, a text a robot.
    console
        Where to; None: standard output.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    more = columns or {}
    table = Table(title=title)
    for heading in ("robot", "arrived", "off, m", "touched", *more):
        table.add_column(heading, justify="left" if heading in ("robot", "arrived", "touched") else "right")
    for i, each in enumerate(outcomes):
        off = "-" if each.distance != each.distance else f"{each.distance:.2f}"
        row = (each.role, "yes" if each.arrived else "no", off, ", ".join(each.touched) or "-")
        table.add_row(*map(Text, (*row, *(texts[i] for texts in more.values()))))
    to = console or Console(width=80, highlight=False)
    to.print(table)
    for each in outcomes:
        if not each.good:
            to.print(str(each), markup=False, soft_wrap=True)
