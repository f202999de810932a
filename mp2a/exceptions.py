"""What can go wrong through no fault of the library, each with a message that says what to change."""


class InputError(ValueError):
    """An argument is not what it has to be: the message names it, what was given and what was expected."""


class DependencyError(RuntimeError):
    """Something this call needs is not on the machine: the message says what, and how to get it."""


class OutputError(OSError):
    """A file cannot be written: the message names it and says why, a full disk for instance.

    Attributes
    ----------
    unsaved : str or None
        What was to be written, if it is text, so that whoever catches this can show it before it is lost.
    """

    unsaved: str | None = None


class RankError(RuntimeError):
    """Something went wrong on one rank in the middle of what all do together: the message says which rank, and what."""
