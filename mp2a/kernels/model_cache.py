"""What is worked out of a model once and lives as long as it does, for models do not change."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from mp2a.model import Model

Entry = TypeVar("Entry")


class ModelCache(Generic[Entry]):
    """Things made of models, which the models hold themselves.

    Parameters
    ----------
    make
        ``make(model, *key)``, called once for a model and a key.
    """

    def __init__(self, make: Callable[..., Entry]) -> None:
        self._make = make

    def get(self, model: Model, *key: Hashable) -> Entry:
        """Return what was made of a model, or make it."""
        place = self, key
        try:
            entry: Entry = model.derived[place]
        except KeyError:
            entry = model.derived[place] = self._make(model, *key)
        return entry
