"""Stability margins of any law, compiled or plugged in, measured in flight unless a closed form is known.

    L_s = -(v - d) / v

In trim, a pulse d of one frame is added to the position of surface s. v: position of the surface minus that
in the same flight without the pulse. v is linear in a small d. L_s, of the transforms of v and d, is the loop
broken at this surface with all other loops closed. studies/margins.py has the same loop of the default law in
closed form, and tests compare the two. The actuators are as declared, and the sensors keep their lag and
delay. Noise and moving air are left out, and no scheme diagnoses.
"""

from collections.abc import Iterator
from itertools import takewhile
from math import ceil

import numpy as np

from beaver_ftc.control import flown_by
from beaver_ftc.control.laws.loop_design import margins
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies import margins as closed_form
from beaver_ftc.studies.margins import Margin
from beaver_ftc.studies.margins_loop import frequencies

PULSE_DEG = 0.1
PULSE_AT_S = 0.5
DURATION_S = 4.0
N_AIRSPEEDS = 2  # the slowest and the fastest of the envelope
DECAYED = 0.2  # a loop is unstable if |v| / |d| is larger than this in the last fifth of the flight
LAG_KEYS = ("delay_s", "bandwidth_rad_s")
NO_MARGIN = 0.0, 0.0, 0.0  # gain up, gain down, phase


def margins_of(scenario: Scenario) -> list[Margin]:
    """The margins of a scenario's law at N_AIRSPEEDS of the envelope, of the surfaces that lead an axis: in
    closed form for a law with the loop of the default law, otherwise measured."""
    flights = closed_form.over_envelope(scenario, N_AIRSPEEDS)
    if scenario.control.law in flown_by("rejecting"):
        return [  # `closed_form.at` yields the margins of the healthy aircraft ("none") before all others
            margin
            for flight in flights
            for margin in takewhile(lambda row: row.fault == "none", closed_form.at(flight))
        ]
    return [margin for flight in flights for margin in _measured(flight)]


def _measured(scenario: Scenario) -> Iterator[Margin]:
    """The margins at one flight condition, from a flight without a pulse and one for each surface."""
    dt = 1.0 / scenario.rate_hz
    trimmed = in_trim(scenario)
    still = _positions(trimmed)
    pulse = {"type": "bias", "bias_deg": PULSE_DEG, "at_s": PULSE_AT_S, "end_s": PULSE_AT_S + dt}
    for surface in scenario.airframe.primary:
        moved = _positions(trimmed.with_({"faults": [{"actuator": surface, **pulse}]}))
        column = f"{surface}_pos_rad"
        numbers = _margins(still[column], moved[column], frequencies(dt), dt)
        yield Margin(scenario.initial.airspeed_mps, "none", surface, *numbers)


def in_trim(scenario: Scenario) -> Scenario:
    """The scenario without faults, references, noise, air and diagnosis."""
    sensors = {
        name: {key: value for key in LAG_KEYS if (value := getattr(sensor, key))}
        for name, sensor in scenario.sensors
        if sensor is not None
    }
    return scenario.with_({
        "duration_s": DURATION_S, "faults": [], "changes": [], "expect": {}, "reference": {},
        "environment": {},
        "sensors": {name: lags for name, lags in sensors.items() if lags},
        "fdi.scheme": "none", "fdi.options": {}, "fdi.statistical": None,
    })  # fmt: skip


def _positions(scenario: Scenario) -> Columns:
    """The position of each primary surface in a flight, (frames,) rad."""
    log = Columns(*(f"{name}_pos_rad" for name in scenario.airframe.primary))
    fly(scenario, log)
    return log


def _margins(still: np.ndarray, moved: np.ndarray, omega: np.ndarray, dt: float) -> tuple[float, ...]:
    """Gain margins up and down, dB, and phase margin, deg. All are 0 if the loop is unstable, if the surface
    is at a stop, and if a flight has ended in a departure. still, moved (frames,) rad: positions without and
    with the pulse."""
    if len(still) != len(moved):
        return NO_MARGIN  # one of the flights has ended in a departure
    v = moved - still
    pulse = np.zeros(len(still))
    pulse[ceil(PULSE_AT_S / dt - 1e-9)] = np.radians(PULSE_DEG)
    at_a_stop = not v.any()  # the pulse does not move the surface
    if at_a_stop or not np.abs(v[-len(v) // 5 :]).max() < DECAYED * np.radians(PULSE_DEG):
        return NO_MARGIN
    v_jw, d_jw = (_transform(np.diff(positions), omega * dt) for positions in (v, pulse))
    return tuple(map(float, margins(-(v_jw - d_jw) / v_jw)))


def _transform(values: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """sum over k of values[k] exp(-i angle k), (m,), of values (n,) that are zero before and after.

    The caller transforms changes from frame to frame. Positions would not return to zero behind an
    integrator.
    """
    return np.exp(-1j * np.outer(angles, np.arange(len(values)))) @ values
