"""The aircraft that names in a scenario are checked against while the scenario is read."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from beaver_ftc.aircraft.aircraft import Aircraft
from beaver_ftc.aircraft.loading import load

_ASKED: ContextVar[Aircraft | None] = ContextVar("aircraft", default=None)


def in_question() -> Aircraft:
    """The aircraft of the scenario being read; outside of one, the built-in aircraft."""
    return _ASKED.get() or load()


@contextmanager
def asked(aircraft: Aircraft) -> Iterator[None]:
    """Check names against this aircraft."""
    token = _ASKED.set(aircraft)
    try:
        yield
    finally:
        _ASKED.reset(token)
