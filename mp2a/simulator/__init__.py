"""A 2-D simulator of skid-steer robots with LIDAR in a world of walls and obstacles; no ROS in it."""

from mp2a.simulator.drive import NO_SLIP, PHYSICS_ENGINE_SLIP, TurnSlip
from mp2a.simulator.lidar import Lidar
from mp2a.simulator.recording import Event, Recorder, Recording
from mp2a.simulator.run import Controller, run
from mp2a.simulator.simulation import Collision, Observation, Simulation
from mp2a.simulator.world import World, box, disc
from mp2a.simulator.world_file import parse as parse_world
from mp2a.simulator.world_file import read as read_world

__all__ = [
    "NO_SLIP",
    "PHYSICS_ENGINE_SLIP",
    "Collision",
    "Controller",
    "Event",
    "Lidar",
    "Observation",
    "Recorder",
    "Recording",
    "Simulation",
    "TurnSlip",
    "World",
    "box",
    "disc",
    "parse_world",
    "read_world",
    "run",
]
