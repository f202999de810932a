"""Methods of inverse dynamics, one a file: what nodes do between their exchanges, and the exchanges."""

from mp2a import schedule
from mp2a.methods import compact, kogge_stone, sweep
from mp2a.methods.node import Method, Work

METHODS = {
    "kogge-stone": Method(schedule.kogge_stone, kogge_stone.MESSAGES, Work(0.1e-6, 0.15e-6), kogge_stone.kogge_stone),
    "compact": Method(schedule.compact, compact.MESSAGES, Work(0.1e-6, 0.02e-6), compact.compact),
    "sweep": Method(schedule.sweep, sweep.MESSAGES, Work(0.1e-6, 0.04e-6), sweep.sweep),
}
"""Every distributed method by name. A new one is a file here and a line in this table."""

__all__ = ["METHODS", "Method"]
