"""What a file is, by how it begins: so that an error can name what was given where another kind was expected."""

import codecs
from pathlib import Path

from mp2a.exceptions import InputError

_BEGINS = (
    (b"\x89MCAP0\r\n", "an MCAP file"),
    (b"SQLite format 3\x00", "an SQLite database, as rosbag2 writes"),
    (b"#ROSBAG V", "a bag of ROS 1"),
    (b"PK\x03\x04", "a zip archive, as numpy's .npz are"),
    (b"\x93NUMPY", "an array of numpy's (.npy)"),
    (b"\x89PNG\r\n", "a PNG picture"),
    (b"GIF8", "a GIF picture"),
    (b"%PDF-", "a PDF document"),
    (b"\x7fELF", "a program"),
    (b"\x1f\x8b", "a gzip archive"),
    *((bytes((0x80, protocol)), "a Python pickle") for protocol in range(2, 6)),
)
_TEXTS = ((("{", "["), "a text, perhaps JSON"), (("<",), "a text, perhaps XML"))
_ENOUGH = 4096  # bytes to look at


def kind_of_file(path: str | Path) -> str:
    """Return what a file is, as words for an error: "an MCAP file", "a text", "a folder", "empty" and the like.

    Parameters
    ----------
    path
        Anything; what cannot be opened is described as well.
    """
    try:
        if Path(path).is_dir():
            return "a folder"
        with Path(path).open("rb") as file:
            begin = file.read(_ENOUGH)
    except FileNotFoundError:
        return "not there"
    except (OSError, ValueError) as error:
        return f"not readable ({getattr(error, 'strerror', None) or error})"
    if not begin:
        return "empty"
    return next((kind for magic, kind in _BEGINS if begin.startswith(magic)), None) or _kind_of_text(begin)


def read_text(path: str | Path, what: str, expected: str) -> str:
    """Read a file of text.

    Parameters
    ----------
    path
        The file.
    what, expected
        As what it is read, and what that is, for the error.

    Raises
    ------
    InputError
        If it cannot be read: the message says what it is instead.
    """
    try:
        return Path(path).read_bytes().decode("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: cannot be read as {what}: it is {kind_of_file(path)}, expected {expected}"
        ) from error


def _kind_of_text(begin: bytes) -> str:
    decoder = codecs.getincrementaldecoder("utf-8")()  # what was read may end within a letter
    try:
        text = decoder.decode(begin).lstrip()
    except UnicodeDecodeError:
        return "of an unknown binary kind"
    if "\x00" in text:
        return "of an unknown binary kind"
    return next((kind for marks, kind in _TEXTS if text.startswith(marks)), "a text")
