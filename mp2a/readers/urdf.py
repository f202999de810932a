"""Chains from URDF files, read by pinocchio, so that q is pinocchio's q."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from mp2a.exceptions import InputError


def read_urdf(path: str | Path) -> dict[str, Any]:
    """Fields of `Model.from_urdf`."""
    import pinocchio

    from mp2a.readers.pinocchio_model import from_model

    file = Path(path)
    try:
        # Parsed once by Python's reader, because the C++ one says on standard error what an exception should say.
        root = ElementTree.fromstring(file.read_bytes())
    except (OSError, ValueError, LookupError, ElementTree.ParseError) as error:
        raise InputError(f"path: {path} cannot be read as URDF ({error})") from error
    if root.tag != "robot":
        raise InputError(f"path: {path} has <{root.tag}> as its root, expected <robot>")
    try:
        model = pinocchio.buildModelFromUrdf(str(file))
    except (ValueError, RuntimeError) as error:
        raise InputError(f"path: {path} cannot be read as URDF ({error})") from error
    return from_model(model)
