"""What is worked out of a chain once and kept as long as the chain lives, for chains do not change."""

import weakref
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from mp2a.model import Model

Entry = TypeVar("Entry")


class ModelCache(Generic[Entry]):
    """Things made of chains, by the chain itself (not by what is in it, which takes long to compare) and a key."""

    def __init__(self) -> None:
        self._held: dict[tuple[int, Hashable], tuple[weakref.ref[Model], Entry]] = {}

    def get(self, model: Model, key: Hashable, make: Callable[[], Entry]) -> Entry:
        """Return what was made of a chain, or make it."""
        place = id(model), key
        known = self._held.get(place)
        if known is None or known[0]() is not model:
            known = weakref.ref(model, lambda _: self._held.pop(place, None)), make()
            self._held[place] = known
        return known[1]
