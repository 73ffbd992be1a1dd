"""`ExcitationNeed`: the kind of drive that an experiment must contain to show an effect."""

from __future__ import annotations

from enum import Enum, auto


class ExcitationNeed(Enum):
    """Kinds of drive; an effect declares the one without which no record can show it."""

    HELD_LEVEL = auto()
    """A level that is held for a second or more after a change."""
    REPEATED_PHASE = auto()
    """The same kind of phase, recorded at two times."""
    SEVERAL_AMPLITUDES = auto()
    """Slow loops of two or more amplitudes."""
    BROADBAND = auto()
    """Noise or a multisine, which excite the dynamics."""
