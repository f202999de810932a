"""What a file is, by how it begins: so that an error can name what was given where another kind was expected."""

from pathlib import Path

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
    (b"\x80", "a Python pickle"),
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
    for magic, kind in _BEGINS:
        if begin.startswith(magic):
            return kind
    try:
        text = begin.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(begin) - 3:  # no letter that the end of what was read has cut
            return "of an unknown binary kind"
        text = begin[: error.start].decode("utf-8")
    if "\x00" in text:
        return "of an unknown binary kind"
    return next((kind for marks, kind in _TEXTS if text.lstrip().startswith(marks)), "a text")
