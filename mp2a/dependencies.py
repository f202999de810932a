"""Packages that only some of mp2a needs: imported here, or missed with a word on how to get them."""

import sys
from importlib import import_module
from typing import Any

from mp2a.exceptions import DependencyError, InputError


def need(module: str, *, extra: str, package: str | None = None, purpose: str = "this") -> Any:
    """Import a module of an optional package.

    Parameters
    ----------
    module : str
        The module to import, for example ``"rosbags.highlevel"``.
    extra : str
        The extra of mp2a that installs the package.
    package : str, optional
        The name of the package where it is not that of the module.
    purpose : str, optional
        What needs it, the subject of the error's sentence.

    Returns
    -------
    module
        The module.

    Raises
    ------
    DependencyError
        If it is not installed, or does not load.
    """
    try:
        return import_module(module)
    except ImportError as error:
        top = module.partition(".")[0]
        missing = isinstance(error, ModuleNotFoundError) and error.name == top
        what = "is not installed" if missing else f"does not load ({error})"
        raise DependencyError(f"{purpose} needs {package or top}, which {what}: pip install 'mp2a[{extra}]'") from error


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the tables of a text in TOML, whose parser comes with Python from 3.11 on.

    Parameters
    ----------
    text : str
        The text.
    where : str
        What errors call it.

    Raises
    ------
    DependencyError
        If this Python is older and tomli is not installed.
    InputError
        If it is no TOML.
    """
    parser = need("tomllib" if sys.version_info >= (3, 11) else "tomli", extra="formation", purpose=f"reading {where}")
    try:
        tables: dict[str, Any] = parser.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: cannot be read as TOML ({error})") from error
    return tables
