"""Files of arrays (numpy's ``.npz``) with words about them, written whole or not at all; no pickle is ever loaded."""

import io
import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.lib.npyio import NpzFile

from mp2a.exceptions import InputError
from mp2a.file_kinds import kind_of_file
from mp2a.files import atomic_write

Content = TypeVar("Content")


def save_arrays(path: Path, format_number: int, arrays: Mapping[str, Any], about: Mapping[str, Any]) -> None:
    """Write arrays, and what JSON can say about them.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, format=format_number, about=json.dumps(about), **arrays)
    with atomic_write(path) as new:
        new.write_bytes(file.getvalue())


def load_arrays(
    path: str | Path,
    what: str,
    format_number: int,
    names: Collection[str],
    read: Callable[[dict[str, Any], dict[str, Any]], Content],
) -> Content:
    """Read what `save_arrays` wrote.

    Parameters
    ----------
    path
        The file.
    what
        Of ``mp2a march`` it is to be, for errors.
    format_number
        That it is to have.
    names
        Of its arrays.
    read
        Makes the content of the arrays and what was said about them; may raise anything.

    Raises
    ------
    InputError
        If the file cannot be read or holds something else: the message says what it is instead.
    """

    def refused(reason: str) -> InputError:
        expected = f"expected one of mp2a march (.npz, format {format_number})"
        return InputError(f"{path}: cannot be read as a {what}: {reason}, {expected}")

    try:
        file = np.load(path, allow_pickle=False)
        assert isinstance(file, NpzFile)
    except Exception as error:
        raise refused(f"it is {kind_of_file(path)}") from error
    with file:
        if missing := {"format", "about", *names} - set(file.files):
            raise refused(f"it holds {', '.join(file.files[:4])}, … and no {min(missing)}")
        try:
            if file["format"].tolist() != format_number:
                raise ValueError(f"format {file['format']}, expected {format_number}")
            return read({name: file[name] for name in names}, json.loads(str(file["about"])))
        except Exception as error:  # there is no end to what zipfile and numpy raise for a broken file
            # numpy advises to load unsafely what it does not know.
            reason = "a part of it is broken" if "pickle" in str(error) else str(error) or type(error).__name__
            raise refused(reason) from error
