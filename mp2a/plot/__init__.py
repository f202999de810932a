"""Pictures of what was measured, traced and simulated: the paper's figures 9 to 13 and the thesis' 7.5 to 7.8."""

from mp2a.plot.animation import animation
from mp2a.plot.latency import latency
from mp2a.plot.march import march
from mp2a.plot.simulated import simulated
from mp2a.plot.speeds import speeds
from mp2a.plot.speedup import speedup
from mp2a.plot.time import time
from mp2a.plot.timeline import timeline

__all__ = ["animation", "latency", "march", "simulated", "speeds", "speedup", "time", "timeline"]
