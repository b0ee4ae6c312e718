"""Turns a scenario into the frame record that the compiled loop works on.

A stage is configured at one of two instants, each of which is one function here:

    configure_design   from the scenario alone: sensors, belief, thresholds, estimators, allocation,
                       reference. Flights of one design share it: it is made once, and copied.
    configure_at_trim  once the trim is known: what is linearised there, the law, the autopilot, the
                       statistical detector, the sensor monitor.

`assemble` does both. A change in flight assembles the record of its scenario from the same trim.
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.compiled import record, sized
from beaver_ftc.control import state as control
from beaver_ftc.control.outer.setup import set_up_autopilot
from beaver_ftc.control.outer.state import AUTOPILOT, COLUMNS
from beaver_ftc.control.supervisor import SUPERVISOR
from beaver_ftc.design.variants import anchor, mass_of
from beaver_ftc.diagnosis import expectation, schemes
from beaver_ftc.diagnosis.conclusion import assessment_dtype
from beaver_ftc.diagnosis.detection import noise_model
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, RecordSize, size_for
from beaver_ftc.diagnosis.isolation import estimator_names
from beaver_ftc.diagnosis.monitors import redundancy
from beaver_ftc.loop import instrument_records, memory
from beaver_ftc.loop.accounts import accounts_dtype, true_faults_dtype
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.instruments import MEASURED, N_SAMPLED, USUAL_LINE, instruments_dtype
from beaver_ftc.plant.native import RUNNING
from beaver_ftc.plant.sensing import truth_dtype
from beaver_ftc.scenario.builtin import texts_of
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario

# How many columns the log has for estimators, the sensor monitor, sensors with rates of their own, the
# engine, statistical tests.
LOGGED = record(estimators=int, sensor_monitor=int, sampled=int, power=int, tests=int)


@sized
def frame_dtype(n: int, size: RecordSize = USUAL_SIZE, line: int = USUAL_LINE) -> np.dtype:
    """All that a flight of an aircraft with n surfaces remembers between frames; size: of its statistics;
    line: of its delay lines."""
    return record(
        k=int, row=int, dt=float, t=float,  # frame, row of the log, s, s
        running=RUNNING,
        since=int, logged=LOGGED,  # the frame with which this diagnosis has begun
        truth=truth_dtype(n), instruments=instruments_dtype(line), measured=MEASURED,
        belief=expectation.belief_dtype(n), fdi=schemes.diagnosis_dtype(n, size),
        assessment=assessment_dtype(n), faults=true_faults_dtype(n), supervisor=SUPERVISOR,
        control=control.control_dtype(n), autopilot=AUTOPILOT,
        held=int, held_rad=n,  # whether another than the law commands, and what
        accounts=accounts_dtype(n), departed=int,
    )  # fmt: skip


_DESIGN = ("fdi", "control", "design_model", "actuators", "sensors")
_MOST_DESIGNS = 32
_designs: dict[tuple[object, ...], np.ndarray] = {}


class Trim(NamedTuple):
    """The state in trim. x (3,): rates, rad/s; y: the measured signals beside them; u (n,) rad: surfaces."""

    x: np.ndarray
    y: np.ndarray
    u: np.ndarray


def assemble(scenario: Scenario, trim: Trim, travel: np.ndarray) -> np.ndarray:
    """The frame record, shape (1,), of a flight about to start from this trim; travel (2, n) rad: lower and
    upper stops. The truth's nodes are attached by the loop."""
    frames = configure_design(scenario, travel)
    configure_at_trim(frames[0], scenario, trim)
    return frames


def configure_design(scenario: Scenario, travel: np.ndarray) -> np.ndarray:
    """A record in which every stage that needs no trim is configured: a copy of that of its design."""
    initial = tuple(scenario.initial.model_dump(exclude={"airspeed_mps"}).values())
    rates, failing = (scenario.rate_hz, scenario.substeps), instrument_records.breaks_instruments(scenario)
    line = instrument_records.line_for(scenario)
    key = scenario.airframe, texts_of(scenario, _DESIGN), rates, failing, line, initial, travel.tobytes()
    if key not in _designs:
        if len(_designs) >= _MOST_DESIGNS:
            _designs.clear()
        _designs[key] = _assemble_design(scenario, travel, line)
    frames = memory.copied(_designs[key])
    instrument_records.seed(frames[0]["instruments"], scenario.seed)
    return frames


def configure_at_trim(frame: np.void, scenario: Scenario, trim: Trim) -> None:
    """Configure the stages that depend on the trim, in a record of `configure_design`."""
    configure_diagnosis_at_trim(frame, scenario, trim)
    stage = frame["control"]
    stage["allocation"]["output"]["command"] = trim.u
    control.configure_law(stage, frame["belief"], scenario, trim.y)
    set_up_autopilot(frame["autopilot"], stage, scenario)


def configure_diagnosis_at_trim(frame: np.void, scenario: Scenario, trim: Trim) -> None:
    """The same of a diagnosis without a law: belief, sensor monitor, statistical detector."""
    belief, fdi, declared = frame["belief"], frame["fdi"], Declared.of(scenario)
    design = belief["design"]
    belief["u"] = belief["commanded"] = frame["control"]["layout"]["trim"] = trim.u
    anchor(design, *trim)
    redundancy.configure_monitor(fdi["sensor_monitor"], scenario, design, trim.y, declared.monitors_sensors)
    mass = mass_of(scenario.design_model, scenario.airframe)
    noise_model.configure_statistics(
        fdi, scenario.fdi, declared, design, mass, (trim.x, trim.y, trim.u), scenario.rate_hz
    )


def _assemble_design(scenario: Scenario, travel: np.ndarray, line: int) -> np.ndarray:
    """The record of a design, made again."""
    aircraft, dt = scenario.airframe, 1.0 / scenario.rate_hz
    frames = memory.taken_empty((1,), frame_dtype(aircraft.n, size_for(aircraft), line))
    frame, instant_s = frames[0], dt / scenario.substeps
    frame["dt"], frame["accounts"]["guarantee"]["certain_after_s"] = dt, -1.0
    truth, channels = frame["truth"], instrument_records.truth_read(scenario)
    truth["n"], truth["declared"] = len(channels), len(aircraft.signals)
    truth["factor"][: len(channels)] = [factor for _, _, factor in channels]
    instrument_records.configure(frame["instruments"], scenario, instant_s)
    expectation.configure(frame["belief"], scenario, travel)
    schemes.configure_diagnosis(frame["fdi"], frame["belief"], scenario, travel)
    control.configure(frame["control"], scenario, travel)
    return frames


def y_places(frame: np.void) -> list[int]:
    """Where in the truth the measured signals beside the rates are: y without noise, (4 + declared,)."""
    first = ch.POS + 3 * frame["belief"]["u"].size
    return [ch.ALPHA, ch.BETA, ch.AIRSPEED, ch.QDYN, *range(first, first + int(frame["truth"]["declared"]))]


def lay_out(frame: np.void, scenario: Scenario, diagnoses_itself: bool) -> tuple[str, ...]:
    """Note in a flight's record what there are columns for; returns their names."""
    fdi, logged, profile = frame["fdi"], frame["logged"], bool(frame["autopilot"]["enabled"])
    aircraft, tests = scenario.airframe, fdi["statistical"]["tests"]
    estimators = estimator_names(scenario.fdi.fault_class, aircraft) if diagnoses_itself else ()
    logged["estimators"] = fdi["isolation"]["config"]["n"] if diagnoses_itself else 0
    watched = logged["sensor_monitor"] = instrument_records.columns_of_the_monitor(scenario)
    sampled = instrument_records.reads_further(scenario)
    logged["sampled"] = N_SAMPLED if sampled else 0
    moved = frame["control"]["power"]["config"]["enabled"] or (profile and aircraft.airspeed_by == "power")
    moved |= bool(frame["control"]["engines"]["config"]["n"])
    power = aircraft.power_setting if moved else ""
    logged["power"] = 1 + len(aircraft.effectors) if power else 0
    logged["tests"] = tests["n_log_columns"] if tests["enabled"] else 0
    tested, columns = bool(tests["enabled"]), COLUMNS if profile else ()
    return ch.log_columns(aircraft, estimators, watched, power, columns, tested, sampled)
