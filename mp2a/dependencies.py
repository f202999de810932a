"""Packages that only some of mp2a needs: imported here, or missed with a word on how to get them."""

from importlib import import_module
from typing import Any

from mp2a.exceptions import DependencyError


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
