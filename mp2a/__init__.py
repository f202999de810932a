"""mp2a: a formation of robots computes its own dynamics in O(log2 n) exchanges.

Names and modules are loaded when first used, so that a rank process imports only what it runs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mp2a import algebra as algebra
    from mp2a import cost_model as cost_model
    from mp2a import formation as formation
    from mp2a import kernels as kernels
    from mp2a import launch as launch
    from mp2a import methods as methods
    from mp2a import plot as plot
    from mp2a import robots as robots
    from mp2a import schedule as schedule
    from mp2a import simulator as simulator
    from mp2a import spatial as spatial
    from mp2a import transport as transport
    from mp2a.configuration import difference as difference
    from mp2a.configuration import integrate as integrate
    from mp2a.configuration import neutral as neutral
    from mp2a.configuration import random_configuration as random_configuration
    from mp2a.distributed import DistributedModel as DistributedModel
    from mp2a.dynamics import placements as placements
    from mp2a.dynamics import rnea as rnea
    from mp2a.exceptions import DependencyError as DependencyError
    from mp2a.exceptions import InputError as InputError
    from mp2a.exceptions import OutputError as OutputError
    from mp2a.exceptions import RankError as RankError
    from mp2a.forward_dynamics import aba as aba
    from mp2a.joints import JOINTS as JOINTS
    from mp2a.methods import METHODS as METHODS
    from mp2a.model import Model as Model
    from mp2a.network import EmulatedNetwork as EmulatedNetwork
    from mp2a.process_grid import ProcessGrid as ProcessGrid
    from mp2a.reference import Reference as Reference
    from mp2a.results import ForwardDynamics as ForwardDynamics
    from mp2a.results import InverseDynamics as InverseDynamics
    from mp2a.results import Placement as Placement
    from mp2a.spatial import GRAVITY as GRAVITY

__version__ = "0.1.0"

_HOMES = {
    "DependencyError": "mp2a.exceptions",
    "DistributedModel": "mp2a.distributed",
    "EmulatedNetwork": "mp2a.network",
    "ForwardDynamics": "mp2a.results",
    "GRAVITY": "mp2a.spatial",
    "InputError": "mp2a.exceptions",
    "InverseDynamics": "mp2a.results",
    "JOINTS": "mp2a.joints",
    "METHODS": "mp2a.methods",
    "Model": "mp2a.model",
    "OutputError": "mp2a.exceptions",
    "Placement": "mp2a.results",
    "ProcessGrid": "mp2a.process_grid",
    "RankError": "mp2a.exceptions",
    "Reference": "mp2a.reference",
    "aba": "mp2a.forward_dynamics",
    "difference": "mp2a.configuration",
    "integrate": "mp2a.configuration",
    "neutral": "mp2a.configuration",
    "placements": "mp2a.dynamics",
    "random_configuration": "mp2a.configuration",
    "rnea": "mp2a.dynamics",
}
"""Modules in which the names are."""

_MODULES = (
    "algebra", "cost_model", "formation", "kernels", "launch", "methods", "plot", "robots", "schedule", "simulator",
    "spatial", "transport",
)  # fmt: skip

__all__ = [*_HOMES, *_MODULES, "__version__"]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"mp2a.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'mp2a' has no attribute {name!r}")
    # Kept, for to look it up anew takes as long as the inverse dynamics of an arm.
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
