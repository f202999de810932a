"""mp2a: a formation of robots computes its own dynamics in O(log2 n) exchanges.

Names are loaded when first used, so that a rank process imports only what it runs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mp2a.distributed import DistributedModel as DistributedModel
    from mp2a.dynamics import placements as placements
    from mp2a.dynamics import rnea as rnea
    from mp2a.exceptions import DependencyError as DependencyError
    from mp2a.exceptions import InputError as InputError
    from mp2a.exceptions import RankError as RankError
    from mp2a.model import Model as Model
    from mp2a.network import EmulatedNetwork as EmulatedNetwork
    from mp2a.process_grid import ProcessGrid as ProcessGrid
    from mp2a.results import InverseDynamics as InverseDynamics

__version__ = "0.1.0"

_HOMES = {
    "ProcessGrid": "mp2a.process_grid",
    "RankError": "mp2a.exceptions",
    "Model": "mp2a.model",
    "DistributedModel": "mp2a.distributed",
    "EmulatedNetwork": "mp2a.network",
    "InputError": "mp2a.exceptions",
    "InverseDynamics": "mp2a.results",
    "DependencyError": "mp2a.exceptions",
    "placements": "mp2a.dynamics",
    "rnea": "mp2a.dynamics",
}

__all__ = [*_HOMES, "__version__"]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mp2a' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
