"""What is read off a flight's record: of each part set by hand what the landing says, in kept documents."""

from math import inf, radians

import numpy as np
import pytest

from beaver_ftc.diagnosis.state import STATISTICAL_DETECTOR, UNANTICIPATED
from beaver_ftc.loop.assembly import Trim, assemble
from beaver_ftc.loop.outcome import guaranteed_delay_s, landing_of, verdict_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import TIME_TOLERANCE_S

SURFACES = ("aileron", "elevator", "rudder", "flap")
TRIM, Y = np.array([0.01, -0.02, 0.03, 0.04]), np.array([0.1, 0.02, 45.0, 1036.0, 0.3])
TRAVEL = np.array([[-0.5, -0.4, -0.3, -0.1], [0.5, 0.45, 0.35, 1.0]])
ALARM = {"fdi.verdict.detected": 1, "fdi.verdict.detected_at_s": 2.25, "fdi.verdict.axis": 1}
NAMED = ALARM | {"fdi.verdict.isolated_estimator": 1, "fdi.verdict.isolated_at_s": 2.5}
PILOT = {"autopilot.enabled": 1, "autopilot.is_commanded": [1, 1, 0, 1]}

# Of each case the scenario's keys, and what is put into the record of its flight.
CASES = {
    "tracked": ({}, {
        "k": 301, "t": 3.0, "accounts.tracking.before": [4e-4, 1e-4, 9e-4],
        "accounts.tracking.frames_before": 100, "accounts.tracking.since": [1.0, 4.0, 16.0],
        "accounts.tracking.frames_since": 4,
        "accounts.authority.demanded": [0.8, 0.0, 8.0], "accounts.authority.lacking": [0.2, 0.0, 6.0],
        "accounts.authority.beyond_frames": [5, 0, 7], "accounts.saturated_frames": [1, 2, 3, 4],
        "accounts.actuator_travel": [0.1, 0.2, 0.3, 0.4],
        "accounts.actuator_energy": [1.0, 2.0, 3.0, 4.0],
        "truth.value.5": 50.0, "truth.value.12": 1500.0,
    }),
    "modes-and-exits": ({}, {
        "k": 900, "t": 8.99, "departed": 30,
        "supervisor.n_modes": 3, "supervisor.mode_at_s": [0.0, 1.5, 2.0, 7.0],
        "supervisor.mode_is": [0, 1, 3, 2], "accounts.envelope.n_exits": 2,
        "accounts.envelope.outside_frames": 150, "accounts.envelope.exit_at_s": [2.0, 8.0, 5.0],
        "accounts.envelope.return_at_s": [3.0, inf, 6.0],
    }),
    "alarm": ({}, ALARM | {"fdi.bank.output.peak": [0.2, 0.7, 0.9],
                           "fdi.bank.config.n_filters": 2,
                           "fdi.isolation.estimator.2.excluded": 1}),
    "named": ({}, NAMED | {"fdi.isolation.estimator.0.excluded": 1, "fdi.isolation.estimator.2.excluded": 1,
                           "fdi.isolation.estimator.1.theta": [-0.1, -0.4, -0.7],
                           "fdi.bank.config.n_filters": 0,
                           "fdi.bank.output.peak": [0.3, 0.7]}),
    "a-damage-besides": ({"aircraft": "beaver", "fdi": {"fault_class": "published"}}, ALARM | {
        "fdi.isolation.estimator.0.excluded": 1, "fdi.isolation.config.losable": [0, 1, 0, 1],
    }),
    "a-damage-excluded": ({}, NAMED | {
        "fdi.isolation.estimator.0.excluded": 1, "fdi.isolation.estimator.2.excluded": 1,
        "fdi.isolation.config.losable": [0, 1, 0, 1],
    }),
    "named-first": ({}, NAMED | {
        "fdi.verdict.isolated_estimator": 0, "fdi.isolation.estimator.0.theta": [-0.3, -0.5, -0.7],
    }),
    "nothing": ({}, {}),
    "alarm-at-once": ({}, ALARM | {"fdi.verdict.detected_at_s": 0.0}),
    "unanticipated": ({}, ALARM | {"fdi.verdict.isolated_estimator": UNANTICIPATED,
                                   "fdi.verdict.isolated_at_s": 3.0}),
    "withdrawn": ({}, ALARM | {
        "fdi.verdict.isolated_estimator": UNANTICIPATED, "fdi.verdict.isolated_at_s": 3.0,
        "fdi.verdict.n_gone": 2,
        "fdi.verdict.gone.surface": [1, 3, 2],
        "fdi.verdict.gone.from_s": [2.0, 2.5, 4.0],
        "fdi.verdict.gone.to_s": [2.25, 3.0, 5.0],
    }),
    "statistical": ({"fdi": {"statistical": {}}}, ALARM | {
        "fdi.statistical.alarm.detected_at_s": 2.0,
        "fdi.statistical.alarm.peak": 0.95,
        "fdi.statistical.test.alarm_level": 6.5,
    }),
    "engine": ({}, {
        "control.power.config.enabled": 1, "control.power.output.from_s": 0.0,
        "control.power.output.frames": 250, "control.power.output.least": 11.5,
        "control.power.output.greatest": 30.25,
    }),
    "engine-not-used": ({}, {"control.power.config.enabled": 1, "control.power.output.from_s": -1.0}),
    "no-engine": ({}, {"control.power.output.from_s": 1.0}),
    "probed": ({"fdi": {"fault_class": "all", "probing": {}}}, {
        "t": 9.0, "control.probe.memory.from_s": 0.0, "control.probe.memory.to_s": 4.5,
    }),
    "still-probing": ({"fdi": {"fault_class": "all", "probing": {}}}, {
        "t": 9.0, "control.probe.memory.from_s": 2.0,
    }),
    "probed-for-nothing": ({}, {"t": 9.0, "control.probe.memory.from_s": 2.0}),
    "profile": ({}, PILOT | {
        "autopilot.largest_deviation": [5.0, 2.5, 0.4, 0.2],
        "autopilot.largest_deviation_from_airspeed_to_fly": 1.25,
        "autopilot.largest_instant_airspeed_deviation": 4.5,
        "autopilot.mean_deviation": [-1.0, 0.5, 0.1, -0.1],
    }),
    "profile-without-speed": ({}, PILOT | {
        "autopilot.is_commanded": [1, 0, 1, 0], "autopilot.largest_deviation_from_airspeed_to_fly": 1.25,
    }),
    "profile-of-nothing": ({}, PILOT | {"autopilot.is_commanded": [0, 0, 0, 0]}),
    "limits": ({}, PILOT | {
        "autopilot.holding.from_s": [5.0, 3.0, 0.0], "autopilot.holding.value": [55.0, 38.5, radians(25.0)],
        "autopilot.holding.in_force": [1, 0, 1], "autopilot.holding.mean_acting_elevator": radians(-4.25),
        "control.surfaces.output.effectiveness": [0.8, 0.1, 0.35, 0.0],
    }),
    "limits-of-roll": ({}, PILOT | {
        "autopilot.holding.from_s": [-1.0, -1.0, 2.0], "autopilot.holding.value": [55.0, 38.5, radians(25.0)],
        "control.surfaces.output.effectiveness": [0.8, 0.1, 0.9, 0.0],
    }),
    "no-limits": ({}, {"autopilot.holding.from_s": [5.0, 3.0, 0.0]}),
    "instrument": ({"fdi": {"sensor_monitor": "always"}}, ALARM | {
        "t": 5.0, "fdi.sensor_monitor.output.alarmed": 1, "fdi.sensor_monitor.output.alarmed_at_s": 1.5,
        "fdi.sensor_monitor.output.isolated_sensor": 1, "fdi.sensor_monitor.output.isolated_at_s": 1.75,
    }),
}  # fmt: skip


def _put(frame, values):
    for path, value in values.items():
        *way, last = (int(part) if part.isdigit() else part for part in path.split("."))
        record = frame
        for part in way:
            record = record[part]
        if isinstance(last, str) and np.ndim(record[last]):
            record[last][: np.size(value)] = value
        else:
            record[last] = value


def _record(keys, values):
    scenario = Scenario.model_validate({"name": "x", **keys})
    frames = assemble(scenario, Trim(np.zeros(3), Y, TRIM, TRIM), TRAVEL)
    frames["autopilot"]["holding"]["from_s"] = -1.0
    _put(frames[0], values)
    return scenario, frames[0]


def _said(landing):
    return {name: value for name, value in vars(landing).items() if name not in ("scenario", "columns")}


@pytest.mark.parametrize("case", CASES)
def test_what_a_record_says(case, changed):
    """All of it for two flights; of the others what differs from a flight of nothing."""
    scenario, frame = _record(*CASES[case])
    said, nothing = _said(landing_of(scenario, frame, ())), _said(landing_of(*_record({}, {}), ()))
    verdict = verdict_of(frame, SURFACES)
    assert verdict.detected is (said["detection_time_s"] is not None)
    assert verdict[:3] == (verdict.detected, said["detection_axis"], said["isolated"])
    assert (verdict.type, verdict.estimate, verdict.candidates) == (
        said["isolation_type"], said["estimate"], said["candidates"],
    )  # fmt: skip
    assert not changed(
        {
            name: value
            for name, value in said.items()
            if case in ("tracked", "nothing") or value != nothing[name]
        }
    )


FAULTED = {"truth.faulted": 1, "truth.fault_at_s": 2.0, "accounts.guarantee.certain_after_s": 2.5}
FAULT = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 2.0}
BROKEN = {"sensor": "q", "type": "bias", "magnitude": 3.0}
WRONG = {"uncertainty": {"coefficients": {"Cm_q": 1.5}}}
NOISY = {"q": {"noise_std_deg_s": 1.0}}


@pytest.mark.parametrize(
    ("keys", "values", "plugged", "certain"),
    [
        ({}, {}, False, True), ({}, {}, True, False),
        ({}, {"accounts.guarantee.certain_after_s": -1.0}, False, False),
        ({}, {"truth.faulted": 0}, False, False),
        ({}, ALARM, False, True),  # after the fault
        ({}, ALARM | {"fdi.verdict.detected_at_s": 2.0}, False, True),
        ({}, ALARM | {"fdi.verdict.detected_at_s": 2.0 - TIME_TOLERANCE_S}, False, True),
        ({}, ALARM | {"fdi.verdict.detected_at_s": 1.99}, False, False),
        ({}, {"fdi.verdict.detected_at_s": 1.99}, False, True),
        ({}, {"fdi.config.authority": STATISTICAL_DETECTOR}, False, False),
        ({}, {"fdi.sensor_monitor.output.alarmed": 1}, False, False),
        ({"faults": [FAULT, BROKEN | {"at_s": 2.5}]}, {}, False, False),
        ({"faults": [FAULT, BROKEN | {"at_s": 2.51}]}, {}, False, True),
        (WRONG, {}, False, False), ({"sensors": NOISY}, {}, False, False),
        ({"changes": [{"at_s": 2.5, "sensors": NOISY}]}, {}, False, False),
        ({"changes": [{"at_s": 2.51, "sensors": NOISY}]}, {}, False, True),
    ],
)  # fmt: skip
def test_when_detection_was_certain(keys, values, plugged, certain):
    scenario, frame = _record({"faults": [FAULT], **keys}, FAULTED | values)
    assert guaranteed_delay_s(frame, scenario, plugged) == (pytest.approx(0.5) if certain else None)
