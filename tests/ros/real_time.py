"""Whether this machine kept real time while a test ran. If not, the run says nothing about our code.

real_time.py LOG        wakes up every 50 ms and does nothing else; on SIGTERM writes how late it ever was to LOG
"""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

PERIOD = 0.05
LATE, LATEST = 0.025, 0.15
"""s by which a process that does nothing may be late one time in a hundred, and ever: a third of the gap between
commands, and half of what makes a robot give up on its LIDAR."""


class TooBusy(Exception):
    """This machine did not keep real time: the test is to be repeated."""


class Metronome:
    """A process that would have kept its times if the machine had let it."""

    def __init__(self, log):
        self._log = log
        self._process = subprocess.Popen([sys.executable, "-I", __file__, str(log)])

    def check(self, behind=0.0):
        """End it; raises TooBusy if it was late, or a simulated world ever was ``behind`` s."""
        self._process.terminate()
        self._process.wait(30)
        late = json.loads(self._log.read_text())
        usual = sorted(late)[int(0.99 * len(late))]
        lateness = f"a process that does nothing: {usual:.4f} s late at the 99th percentile, {max(late):.4f} s at most"
        print(lateness)
        if usual > LATE or max(late) > LATEST:
            raise TooBusy(lateness)
        if behind > LATEST:
            raise TooBusy(f"the physics engine fell {behind:.3f} s behind real time")

    def kill(self):
        self._process.kill()
        self._process.wait()


def main():
    over, late = [], [0.0]
    signal.signal(signal.SIGTERM, lambda *_: over.append(True))
    due = time.monotonic()
    while not over:
        due += PERIOD
        time.sleep(max(0.0, due - time.monotonic()))
        late.append(time.monotonic() - due)
    Path(sys.argv[1]).write_text(json.dumps(late))


if __name__ == "__main__":
    main()
