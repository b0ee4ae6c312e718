"""What a flight yields, and where its log goes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from beaver_ftc.scenario.schema import Scenario


class LogSink(Protocol):
    """Takes the log as it is flown, in chunks: a ten-hour flight has 3.6 million rows."""

    def open(self, columns: Sequence[str]) -> None:
        """Called once, with the columns in order."""

    def write(self, rows: np.ndarray) -> None:
        """rows (n, columns), float64; the array is reused afterwards."""

    def close(self) -> None:
        """Called once, after the last row."""


@dataclass(frozen=True)
class Flight:
    """Everything the metrics need; times in s since the start, rates in rad/s, per axis (p, q, r).

    isolated: aileron, elevator, rudder, flap, unanticipated, or None while more than one fault fits
    (`candidates`). estimate: the isolated fault's parameter, theta in [-1, 0] for a loss of effectiveness.
    guaranteed_delay_s: from the fault to the instant from which detection was certain, None if that never
    came. worst_residual_ratio: largest |residual| / threshold in healthy flight; closest_approach: the same
    of each filter of the bank, the published one first. surface_travel_rad: path of each surface, up and
    down added. engine_power: if pitch was left to the engine, since when and for how long, s, and the lowest
    and highest manifold pressure, inHg. faults: of several at once (`fdi.pairs`), as in types/findings.py,
    the first named first. statistical: when the statistical detector would have raised the alarm, its level
    in standard deviations, and the largest share of it reached in healthy flight. mode_changes, exits: how
    many there were of `supervisor` and `envelope_exits`, which hold the first and the last; outside_s: time
    outside the validated envelope, all exits together. end: airspeed, m/s, and altitude, m, at the end.
    profile: largest deviation from the commanded one by
    channel of the autopilot, m, m/s, rad; None where it was not flown. arrival: the deviation's mean over the
    last 10 s, with its sign. limits: of each limit that protection
    has put on the command since when, s, on what (airspeed_mps, bank_deg), "at most" or "at least", its value
    at last, SI, why, and whether it is in force at the end. changes: what was changed in flight:
    time_s; law and scheme, None for what was not; sensors, True or False; and of a diagnosis that was
    replaced detection_time_s and isolated. The verdict above is the last diagnosis'.
    """

    scenario: Scenario
    frames: int
    columns: tuple[str, ...]
    detection_time_s: float | None
    detection_axis: str | None
    guaranteed_delay_s: float | None
    isolation_time_s: float | None
    isolated: str | None
    isolation_type: str | None
    candidates: tuple[str, ...]
    estimate: float | None
    pre_fault_rms_rad_s: tuple[float, float, float]
    post_fault_rms_rad_s: tuple[float, float, float] | None
    supervisor: tuple[tuple[float, str], ...]
    envelope_exits: tuple[tuple[float, float], ...]
    departure: tuple[float, str] | None
    saturation_s: dict[str, float]
    worst_residual_ratio: float
    closest_approach: tuple[float, ...] = ()
    surface_travel_rad: dict[str, float] = field(default_factory=dict)
    surface_energy_rad2_s: dict[str, float] = field(default_factory=dict)
    type_time_s: float | None = None
    estimate_interval: tuple[float, float] | None = None
    frequency_rad_s: float | None = None
    authority: dict[str, tuple[float, float]] | None = None
    probing_s: tuple[float, float] | None = None
    engine_power: tuple[float, float, float, float] | None = None
    faults: tuple[dict[str, Any], ...] = ()
    statistical: dict[str, float | None] | None = None
    mode_changes: int = 0
    exits: int = 0
    outside_s: float = 0.0
    end: tuple[float, float] | None = None
    profile: dict[str, float | None] | None = None
    arrival: dict[str, float | None] | None = None
    limits: tuple[tuple[float, str, str, float, str, bool], ...] = ()
    changes: tuple[dict[str, Any], ...] = ()
