"""Models from the files that `mp2a.Model.save` writes."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from mp2a.exceptions import InputError


def read_model(path: str | Path, form: int, names: Collection[str]) -> dict[str, Any]:
    """Return the fields for `Model.load`, which are all that a file of this format has."""
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {key: file[key] for key in file.files}
    except Exception as error:  # zipfile, zlib and numpy raise a dozen kinds on a damaged file
        raise InputError(f"path: {path} cannot be read as a model ({error})") from error
    if set(data) != {"format", *names} or data.pop("format").tolist() != form:
        raise InputError(f"path: {path} holds {sorted(data)}, expected a model of format {form}")
    data["joints"], data["names"] = (tuple(str(word) for word in data[key].flat) for key in ("joints", "names"))
    return data
