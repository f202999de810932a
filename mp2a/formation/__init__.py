"""Formations by dynamics: paths, shapes, virtual joints that yield to obstacles, setpoints for robots."""

from mp2a.formation.controller import FormationController, Setpoints
from mp2a.formation.exchange import LocalExchange, MPIExchange
from mp2a.formation.formation import Formation
from mp2a.formation.obstacles import ObstacleLaw
from mp2a.formation.paths import Arc, Line, Path, lines_and_arcs, spline, waypoints
from mp2a.formation.sensing import Discs, SensedPoints, pack
from mp2a.formation.shapes import SHAPES
from mp2a.formation.speed import Limits
from mp2a.formation.springs import Springs

__all__ = [
    "SHAPES",
    "Arc",
    "Discs",
    "Formation",
    "FormationController",
    "Limits",
    "Line",
    "LocalExchange",
    "MPIExchange",
    "ObstacleLaw",
    "Path",
    "SensedPoints",
    "Setpoints",
    "Springs",
    "lines_and_arcs",
    "pack",
    "spline",
    "waypoints",
]
