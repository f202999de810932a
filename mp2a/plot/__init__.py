"""Pictures of what was measured, traced and simulated: the paper's figures 9 to 13 and the thesis' 7.5 to 7.8."""

from mp2a.plot.animation import save_animation
from mp2a.plot.latency import latency_figure
from mp2a.plot.march import march_figure
from mp2a.plot.scaling import scaling_figure
from mp2a.plot.simulated import simulated_figure
from mp2a.plot.speeds import speeds_figure
from mp2a.plot.speedup import speedup_figure
from mp2a.plot.style import save_figure
from mp2a.plot.time import time_figure
from mp2a.plot.timeline import timeline_figure

__all__ = [
    "latency_figure",
    "march_figure",
    "save_animation",
    "save_figure",
    "scaling_figure",
    "simulated_figure",
    "speeds_figure",
    "speedup_figure",
    "time_figure",
    "timeline_figure",
]
