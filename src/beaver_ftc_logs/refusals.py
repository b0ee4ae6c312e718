"""The form of every message that refuses an input."""

from beaver_ftc.documents import BadInput


def refusal(place: object, reason: str, allowed: str) -> BadInput:
    """The error `place: reason, allowed: ...`. place: the file, flight, option or column that is refused."""
    return BadInput(f"{place}: {reason}, allowed: {allowed}")
