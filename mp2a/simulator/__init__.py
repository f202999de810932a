"""A 2-D simulator of skid-steer robots with LIDAR in a world of walls and obstacles; no ROS in it."""

from mp2a.simulator.choreography_driver import ChoreographySimulationDriver as ChoreographySimulationDriver
from mp2a.simulator.events import EventKind as EventKind
from mp2a.simulator.events import RobotEvent as RobotEvent
from mp2a.simulator.formation_driver import FormationSimulationDriver as FormationSimulationDriver
from mp2a.simulator.lidar import Lidar as Lidar
from mp2a.simulator.loop import Controller as Controller
from mp2a.simulator.loop import simulate as simulate
from mp2a.simulator.observation import Observation as Observation
from mp2a.simulator.recording import Recording as Recording
from mp2a.simulator.recording import RunRecorder as RunRecorder
from mp2a.simulator.recording_file import load_recording as load_recording
from mp2a.simulator.recording_file import save_recording as save_recording
from mp2a.simulator.simulation import Simulation as Simulation
from mp2a.simulator.vehicle import NO_SLIP as NO_SLIP
from mp2a.simulator.vehicle import PHYSICS_ENGINE_SLIP as PHYSICS_ENGINE_SLIP
from mp2a.simulator.vehicle import TurnSlip as TurnSlip
from mp2a.simulator.world import World as World
from mp2a.simulator.world import box as box
from mp2a.simulator.world import disc as disc
from mp2a.simulator.world_file import parse_world as parse_world
from mp2a.simulator.world_file import read_world as read_world
