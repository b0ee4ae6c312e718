"""The aircraft that names in a scenario are checked against while the scenario is read."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from beaver_ftc.aircraft.aircraft import Aircraft
from beaver_ftc.aircraft.loading import load

_ASKED: ContextVar[tuple[Aircraft, str | None] | None] = ContextVar("aircraft", default=None)


def in_question() -> Aircraft:
    """The aircraft of the scenario being read; outside of one, the built-in aircraft."""
    asked_for = _ASKED.get()
    return asked_for[0] if asked_for else load()


def named(reference: str | None, beside: Path | None) -> Aircraft:
    """What a scenario calls its aircraft, if anything: the one in question if that is its name already."""
    asked_for = _ASKED.get()
    if reference is None or (asked_for and asked_for[1] == reference):
        return in_question()
    return load(reference, beside)


@contextmanager
def asked(aircraft: Aircraft, reference: str | None = None) -> Iterator[None]:
    """Check names against this aircraft; `reference` is what a scenario calls it."""
    token = _ASKED.set((aircraft, reference))
    try:
        yield
    finally:
        _ASKED.reset(token)
