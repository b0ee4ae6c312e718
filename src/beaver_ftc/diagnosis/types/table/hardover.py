"""A runaway to a stop: by each frame it has come at least as far as its least rate takes it, and it stays."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import release
from beaver_ftc.diagnosis.types.contract import FIXED, FaultType


@kernel
def way(config, surface, k):
    """The least way (rad) a runaway has gone by a frame; over a block the mean was reached within it."""
    elapsed = k - surface.evidence.started_at
    if config.length > 1:
        elapsed = max(elapsed - 1, 0)
    return surface.actuator.least_runaway_rate * config.span_s * elapsed


@kernel
def upwards(config, surface, k):
    """How far up a runaway has come by a frame, at least: rad, the stop at most."""
    if surface.evidence.started_at < 0:
        return surface.actuator.travel_low
    return min(surface.actuator.travel_high, surface.evidence.start_low + way(config, surface, k))


@kernel
def downwards(config, surface, k):
    """How far down one has come: rad, the stop at most."""
    if surface.evidence.started_at < 0:
        return surface.actuator.travel_high
    return max(surface.actuator.travel_low, surface.evidence.start_high - way(config, surface, k))


@kernel
def judge_up(config, surface, kind, k):
    """It is beyond where its least rate takes it, or at the stop."""
    return release.explains(config, surface, kind, upwards(config, surface, k), surface.actuator.travel_high)


@kernel
def judge_down(config, surface, kind, k):
    """The same downwards."""
    return release.explains(config, surface, kind, surface.actuator.travel_low, downwards(config, surface, k))


@kernel
def on_release_up(config, surface, kind, k):
    """It may be released on its way; within a frame of several instants, further on."""
    low, high, shown = release.beginning(config, surface, k)
    low = max(low, upwards(config, surface, shown))
    if not config.whole and low <= high:
        high = surface.actuator.travel_high
    release.note_release(surface, kind, low, high)


@kernel
def on_release_down(config, surface, kind, k):
    """The same downwards."""
    low, high, shown = release.beginning(config, surface, k)
    high = min(high, downwards(config, surface, shown))
    if not config.whole and low <= high:
        low = surface.actuator.travel_low
    release.note_release(surface, kind, low, high)


@kernel
def deflection_up(config, surface, kind, k):
    """Between its least way and the stop."""
    return upwards(config, surface, k), surface.actuator.travel_high


@kernel
def deflection_down(config, surface, kind, k):
    """The same downwards."""
    return surface.actuator.travel_low, downwards(config, surface, k)


def upper_stop(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["travel_high"])


def lower_stop(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["travel_low"])


UP = FaultType(
    name="hardover", words="hardover up", constant=True, rank=4,
    begin=release.start, judge=judge_up, on_release=on_release_up, propagate_release=release.propagate,
    deflection=deflection_up, direction=1, accommodation=FIXED, estimate=upper_stop,
)  # fmt: skip
DOWN = FaultType(
    name="hardover", words="hardover down", constant=True, rank=5,
    begin=release.start, judge=judge_down, on_release=on_release_down, propagate_release=release.propagate,
    deflection=deflection_down, direction=-1, accommodation=FIXED, estimate=lower_stop,
)  # fmt: skip
TYPES = UP, DOWN
