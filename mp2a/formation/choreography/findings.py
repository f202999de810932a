"""What is wrong with a scenario: where in the text, or when, who and where in the run."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or at least worth knowing.

    Attributes
    ----------
    kind
        "syntax" and "scenario" (what the text says), "spacing" and "radius" (what shows on paper), "speed" (both),
        "collision", "backwards" and "time" (what a run shows).
    message
        What was found and what was expected.
    serious
        False for what a run survives.
    line, column
        In the text, from 1; None if the finding has no such place.
    time
        When it began and ended in the run, s.
    robots
        Whom it concerns.
    place
        Where it began, x and y in the ground frame, m.
    """

    kind: str
    message: str
    serious: bool = True
    line: int | None = None
    column: int | None = None
    time: tuple[float, float] | None = None
    robots: tuple[str, ...] = ()
    place: tuple[float, float] | None = None

    def __str__(self) -> str:
        where = []
        if self.line is not None:
            where.append(f"line {self.line}" + (f", column {self.column}" if self.column is not None else ""))
        if self.time is not None:
            where.append(f"{self.time[0]:.1f} s to {self.time[1]:.1f} s")
        if self.place is not None:
            where.append(f"at ({self.place[0]:.2f}, {self.place[1]:.2f}) m")
        return f"{', '.join(where) or 'scenario'}: {self.message}"
