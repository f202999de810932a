"""Pictures of what the benchmarks and the trace recorder wrote: the paper's figures 9, 10 and 12 for this machine."""

from mp2a.plot.latency import latency
from mp2a.plot.simulated import simulated
from mp2a.plot.speedup import speedup
from mp2a.plot.time import time
from mp2a.plot.timeline import timeline

__all__ = ["latency", "simulated", "speedup", "time", "timeline"]
