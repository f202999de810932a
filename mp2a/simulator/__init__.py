"""A 2-D simulator of skid-steer robots with LIDAR in a world of walls and obstacles; no ROS in it.

Names are loaded when first used: what drives a robot needs no geometry.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mp2a.simulator.dance import Dance as Dance
    from mp2a.simulator.drive import NO_SLIP as NO_SLIP
    from mp2a.simulator.drive import PHYSICS_ENGINE_SLIP as PHYSICS_ENGINE_SLIP
    from mp2a.simulator.drive import TurnSlip as TurnSlip
    from mp2a.simulator.lidar import Lidar as Lidar
    from mp2a.simulator.loop import Controller as Controller
    from mp2a.simulator.loop import run as run
    from mp2a.simulator.marchers import Marchers as Marchers
    from mp2a.simulator.observation import Event as Event
    from mp2a.simulator.observation import Observation as Observation
    from mp2a.simulator.recording import Recorder as Recorder
    from mp2a.simulator.recording import Recording as Recording
    from mp2a.simulator.simulation import Collision as Collision
    from mp2a.simulator.simulation import Simulation as Simulation
    from mp2a.simulator.world import World as World
    from mp2a.simulator.world import box as box
    from mp2a.simulator.world import disc as disc
    from mp2a.simulator.world_file import parse_world as parse_world
    from mp2a.simulator.world_file import read_world as read_world

_HOMES = {
    "NO_SLIP": ("drive", "NO_SLIP"),
    "PHYSICS_ENGINE_SLIP": ("drive", "PHYSICS_ENGINE_SLIP"),
    "Collision": ("simulation", "Collision"),
    "Controller": ("loop", "Controller"),
    "Dance": ("dance", "Dance"),
    "Event": ("observation", "Event"),
    "Lidar": ("lidar", "Lidar"),
    "Marchers": ("marchers", "Marchers"),
    "Observation": ("observation", "Observation"),
    "Recorder": ("recording", "Recorder"),
    "Recording": ("recording", "Recording"),
    "Simulation": ("simulation", "Simulation"),
    "TurnSlip": ("drive", "TurnSlip"),
    "World": ("world", "World"),
    "box": ("world", "box"),
    "disc": ("world", "disc"),
    "parse_world": ("world_file", "parse_world"),
    "read_world": ("world_file", "read_world"),
    "run": ("loop", "run"),
}

__all__ = [*_HOMES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mp2a.simulator' has no attribute {name!r}")
    home, inside = _HOMES[name]
    value = globals()[name] = getattr(import_module(f"mp2a.simulator.{home}"), inside)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
