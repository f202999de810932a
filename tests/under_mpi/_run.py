"""Runs programs one after another on the same ranks: to start ranks takes longer than most programs do."""

import runpy
import sys
from pathlib import Path

from _formation import COMM, RANK

for program in sys.argv[1:]:
    if RANK == 0:
        print(f"{Path(program).stem}: ", end="", flush=True)
    COMM.Barrier()
    runpy.run_path(program, run_name="__main__")
