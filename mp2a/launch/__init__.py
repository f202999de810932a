"""Start many MPI ranks on the few cores of one machine, and end them all again.

`command` builds the launcher's command, `process` runs it. With modules to preload, the ranks are forked from one
process (`forked`), which mpirun does not know: it starts and watches a stand-in (`stub`) for each rank (`rank`).
"""

from mp2a.launch.command import Launch, mpirun_command
from mp2a.launch.process import Ranks, end, run, start

__all__ = ["Launch", "Ranks", "end", "mpirun_command", "run", "start"]
