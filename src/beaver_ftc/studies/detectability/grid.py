"""What the survey goes over: how soon faults are to be found, speeds, altitudes, excitation."""

from typing import Any

from beaver_ftc.aircraft import Aircraft

DETECT_WITHIN_S, ISOLATE_WITHIN_S = 0.5, 1.0
SPEEDS_MPS, ALTITUDES_M = (36.0, 40.0, 44.0, 48.0, 52.0), (0.0, 1000.0, 2000.0, 3000.0)
SHARES = (0.9, 1.0, 1.1)  # of the speed another aircraft starts with
EXCITATIONS = (0.25, 0.5, 1.0, 2.0)  # of the scenario's references

Row = dict[str, Any]


def speeds_of(aircraft: Aircraft) -> tuple[float, ...]:
    """Speeds to survey, m/s: those of the built-in aircraft, or about where another one starts."""
    start_mps = aircraft.file.start.airspeed_mps
    return SPEEDS_MPS if start_mps is None else tuple(round(share * start_mps, 1) for share in SHARES)


def altitudes_of(aircraft: Aircraft) -> tuple[float, ...]:
    """Altitudes to survey, m: another aircraft's error is known about the one it starts at."""
    start_m = aircraft.file.start.altitude_m
    return ALTITUDES_M if start_m is None else (start_m,)
