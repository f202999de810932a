"""Formations on the march: paths, shapes, virtual joints that yield to obstacles, setpoints for robots.

Names are loaded when first used; `mp2a.formation.ranks` alone needs MPI.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mp2a.formation.exchange import OneProcess as OneProcess
    from mp2a.formation.formation import Formation as Formation
    from mp2a.formation.march import March as March
    from mp2a.formation.obstacles import ObstacleLaw as ObstacleLaw
    from mp2a.formation.paths import Arc as Arc
    from mp2a.formation.paths import Line as Line
    from mp2a.formation.paths import Path as Path
    from mp2a.formation.paths import lines_and_arcs as lines_and_arcs
    from mp2a.formation.paths import spline as spline
    from mp2a.formation.paths import waypoints as waypoints
    from mp2a.formation.ranks import OverRanks as OverRanks
    from mp2a.formation.sensing import Discs as Discs
    from mp2a.formation.sensing import Sensed as Sensed
    from mp2a.formation.sensing import pack as pack
    from mp2a.formation.setpoints import Setpoints as Setpoints
    from mp2a.formation.shapes import SHAPES as SHAPES
    from mp2a.formation.speed import Limits as Limits
    from mp2a.formation.springs import Springs as Springs

_HOMES = {
    "Arc": "paths",
    "Discs": "sensing",
    "Formation": "formation",
    "Limits": "speed",
    "Line": "paths",
    "March": "march",
    "ObstacleLaw": "obstacles",
    "OneProcess": "exchange",
    "OverRanks": "ranks",
    "Path": "paths",
    "SHAPES": "shapes",
    "Sensed": "sensing",
    "Setpoints": "setpoints",
    "Springs": "springs",
    "lines_and_arcs": "paths",
    "pack": "sensing",
    "spline": "paths",
    "waypoints": "paths",
}

__all__ = [*_HOMES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mp2a.formation' has no attribute {name!r}")
    return getattr(import_module(f"mp2a.formation.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
