"""A robot for tests of the watchdog: it writes down what it is sent."""

import json
import time
from pathlib import Path

FILE_PUBLISHER = "file_publisher:FilePublisher"


class FilePublisher:
    """Appends each command to a file, a line ``[monotonic time, speed, turn rate]``.

    A human drives it as long as a file of the same name with ``.human`` added exists.
    """

    def __init__(self, settings):
        self._path = Path(settings["file"])
        self._human = self._path.with_name(self._path.name + ".human")
        self._file = self._path.open("a", buffering=1)

    def send(self, speed, turn_rate):
        self._file.write(json.dumps([time.monotonic(), speed, turn_rate]) + "\n")

    def human(self):
        return self._human.exists()

    def close(self):
        self._file.close()
