"""The results file: JSON, one run a number of robots, each with the machine and the time it was made on."""

import json
from pathlib import Path
from typing import Any

from mp2a import files
from mp2a.exceptions import InputError, OutputError
from mp2a.file_kinds import kind_of_file

FORMAT = 2


def load(path: str | Path) -> dict[str, Any]:
    """Read a results file.

    Parameters
    ----------
    path
        Of a file that `append` wrote.

    Raises
    ------
    InputError
        If it cannot be read or is of another format.
    """
    return read_json(path, "results", "runs")


def append(path: str | Path, run: dict[str, Any]) -> None:
    """Add a run to a results file, which is made if it is not there; whole or not at all, also beside other processes.

    Parameters
    ----------
    path
        Of the file. A device or a FIFO gets a results file with this run alone.
    run
        What was measured.

    Raises
    ------
    InputError
        If there is another kind of file.
    OutputError
        If it cannot be written; its `unsaved` is a results file with this run alone.
    """
    try:
        with files.locked(path):
            results: dict[str, Any] = load(path) if Path(path).is_file() else {"format": FORMAT, "runs": []}
            results["runs"].append(run)
            write_json(path, results)
    except OutputError as error:
        error.unsaved = json.dumps({"format": FORMAT, "runs": [run]}, indent=1)
        raise


def find_run(path: str | Path, processor: str, **settings: Any) -> dict[str, Any] | None:
    """Return the last run of a results file that was made with these settings on such a processor, if there is one."""
    if not Path(path).is_file():
        return None
    wanted = settings.items()
    runs = [run for run in load(path)["runs"] if run["machine"]["processor"] == processor]
    return next((run for run in reversed(runs) if all(run.get(name) == value for name, value in wanted)), None)


def read_json(path: str | Path, what: str, key: str) -> dict[str, Any]:
    """Read a JSON file of this `FORMAT` that holds a list by the name of ``key``.

    Raises
    ------
    InputError
        If it cannot be read or is something else; the message says what was expected.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        found = kind_of_file(path)
        raise InputError(f"{what}: {path} cannot be read as JSON: it is {found} ({error})") from error
    if not isinstance(content, dict) or not isinstance(content.get(key), list):
        raise InputError(f"{what}: {path} is no file of {what}")
    if content.get("format") != FORMAT:
        raise InputError(f"{what}: {path} is of format {content.get('format')}, expected {FORMAT}; measure again")
    return content


def write_json(path: str | Path, content: dict[str, Any]) -> None:
    """Write JSON whole or not at all; see `mp2a.files.write_text`."""
    files.write_text(path, json.dumps(content, indent=1) + "\n")
