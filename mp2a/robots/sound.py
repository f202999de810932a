"""When a robot that an obstacle stops speaks, and when it beeps (thesis, section 5.2)."""

from typing import NamedTuple

TEXT = "Obstacle is too close, I have to stop"
BEEP_EVERY = 3.0
"""s"""
_SAY, _BACKING_UP, _ONCE = -3, 1, 1
"""Of ``sound_play/SoundRequest``; its beep is that of a lorry that backs up."""


class Sound(NamedTuple):
    """What there is to be heard now."""

    say: str | None
    """A sentence."""
    beep: bool
    next_beep: float | None
    """When to beep next, s; None: the way is clear."""


CLEAR = Sound(None, False, None)


def next_sound(before: Sound, blocked: bool, now: float) -> Sound:
    """Return what is heard next: a sentence once the robot has to stop, then beeps as long as the way is not clear."""
    if not blocked:
        return CLEAR
    if before.next_beep is None:
        return Sound(TEXT, False, now + BEEP_EVERY)
    if now < before.next_beep - 1e-9:
        return Sound(None, False, before.next_beep)
    return Sound(None, True, before.next_beep + BEEP_EVERY)


def sound_numbers(text: str | None) -> tuple[int, int]:
    """Return ``sound`` and ``command`` of a ``sound_play/SoundRequest`` that says a text, or (None) beeps."""
    return (_BACKING_UP if text is None else _SAY), _ONCE
