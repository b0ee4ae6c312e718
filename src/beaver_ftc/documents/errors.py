"""What can go wrong, the exit status each kind ends with, and what was perhaps meant."""

from collections.abc import Iterable
from difflib import get_close_matches


class BeaverFtcError(Exception):
    """A failure with a message fit for the user: one line, no traceback."""

    exit_code = 3


class BadInput(BeaverFtcError):
    """The user's input cannot be used: wrong file, key, value, unit, or a flight that cannot be trimmed."""

    exit_code = 2


class SimulationFailed(BeaverFtcError):
    """The simulation could not be completed: a non-finite value, a folder that cannot be written."""

    exit_code = 3


def suggestion(given: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """`, did you mean x?` if something known is near to what was given, and what is allowed."""
    names = list(known)
    lower = {name.lower(): name for name in reversed(names)}
    near = get_close_matches(given.lower()[:100], lower, n=1, cutoff=cutoff)
    hint = f", did you mean {lower[near[0]]}?" if near else ","
    return f"{hint} allowed: {', '.join(names)}"
