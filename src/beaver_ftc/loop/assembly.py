"""From a scenario to the frame record that the compiled loop works on.

A stage is configured at one of two instants, each of which is one function here:

    configure_design   from the scenario alone: sensors, prediction, thresholds, estimators, allocation,
                       reference, autopilot. Flights of one design share it: it is made once, and copied.
    configure_at_trim  once the trim is known: what is linearised there, the law, the statistical detector,
                       the sensor monitor.

`assemble` does both. A change in flight assembles the record of its scenario from the same trim.
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.compiled import record, sized
from beaver_ftc.control import state as control
from beaver_ftc.control.accommodation import SUPERVISOR
from beaver_ftc.control.autopilot_setup import AUTOPILOT, set_up_autopilot
from beaver_ftc.control.profile import COLUMNS
from beaver_ftc.design.plain_model import anchor
from beaver_ftc.diagnosis import model_prediction, schemes
from beaver_ftc.diagnosis.assessment import assessment_dtype
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, StatisticalSize
from beaver_ftc.diagnosis.detection.parity_design import required_size
from beaver_ftc.diagnosis.detection.statistical_design import configure_statistics
from beaver_ftc.diagnosis.isolation import estimator_names
from beaver_ftc.diagnosis.monitors.sensor_monitor_design import configure_sensor_monitor
from beaver_ftc.loop.accounts import accounts_dtype
from beaver_ftc.loop.frame import true_faults_dtype
from beaver_ftc.loop.instrument_setup import (
    are_ever_monitored,
    configure_instruments,
    line_for,
    records_further,
    seed,
)
from beaver_ftc.loop.memory import copied, taken_empty
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.channels import RUNNING
from beaver_ftc.plant.instruments import (
    MEASURED,
    N_SAMPLED,
    USUAL_LINE,
    instruments_dtype,
)
from beaver_ftc.plant.sensing import truth_dtype
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.kept import texts_of
from beaver_ftc.scenario.schema import Scenario

# How many columns the log has for estimators, the sensor monitor, sensors with rates of their own, the
# engine, statistical tests.
LOGGED = record(estimators=int, sensor_monitor=int, sampled=int, power=int, tests=int)


@sized
def frame_dtype(n: int, size: StatisticalSize = USUAL_SIZE, line: int = USUAL_LINE) -> np.dtype:
    """All that a flight of an aircraft with n surfaces remembers between frames; size: of its statistics;
    line: of its delay lines."""
    return record(
        k=int, row=int, dt=float, t=float,  # frame, row of the log, s, s
        running=RUNNING,
        since=int, logged=LOGGED,  # the frame with which this diagnosis has begun
        truth=truth_dtype(n), instruments=instruments_dtype(line), measured=MEASURED,
        prediction=model_prediction.prediction_dtype(n), fdi=schemes.fdi_dtype(n, size),
        assessment=assessment_dtype(n), faults=true_faults_dtype(n), supervisor=SUPERVISOR,
        control=control.control_dtype(n), autopilot=AUTOPILOT,
        held=int, held_rad=n,  # whether another than the law commands, and what
        accounts=accounts_dtype(n), departed=int,
    )  # fmt: skip


_DESIGN = ("fdi", "control", "design_model", "actuators", "sensors", "autopilot")
_MOST_DESIGNS = 32
_designs: dict[tuple[object, ...], np.ndarray] = {}


class Trim(NamedTuple):
    """What is known of the trim before the first reading.

    x (3,) rad/s, y, u (n,) rad: rates, measured signals beside them and surfaces in the designer's trim,
    about which everything is linearised. command (n,) rad: the one in force at the start. It holds the true
    aircraft in its own trim, and a healthy surface stands there.
    """

    x: np.ndarray
    y: np.ndarray
    u: np.ndarray
    command: np.ndarray


def assemble(scenario: Scenario, trim: Trim, travel: np.ndarray) -> np.ndarray:
    """The frame record, shape (1,), of a flight about to start from this trim; travel (2, n) rad: lower and
    upper stops. The truth's nodes are attached by the loop."""
    frames = configure_design(scenario, travel)
    configure_at_trim(frames[0], scenario, trim)
    return frames


def configure_design(scenario: Scenario, travel: np.ndarray) -> np.ndarray:
    """A record in which every stage that needs no trim is configured: a copy of that of its design."""
    initial = tuple(scenario.initial.model_dump(exclude={"airspeed_mps"}).values())
    rates, line = (scenario.rate_hz, scenario.substeps), line_for(scenario)
    key = scenario.airframe, texts_of(scenario, _DESIGN), rates, line, initial, travel.tobytes()
    if key not in _designs:
        if len(_designs) >= _MOST_DESIGNS:
            _designs.clear()
        _designs[key] = _assemble_design(scenario, travel, line)
    frames = copied(_designs[key])
    seed(frames[0]["instruments"], scenario.seed)
    return frames


def configure_at_trim(frame: np.void, scenario: Scenario, trim: Trim) -> None:
    """Configure the stages that depend on the trim, in a record of `configure_design`."""
    configure_diagnosis_at_trim(frame, scenario, trim)
    stage = frame["control"]
    stage["allocation"]["output"]["command"] = trim.command
    control.configure_law(stage, frame["prediction"], Declared.of(scenario), trim.y)


def configure_diagnosis_at_trim(frame: np.void, scenario: Scenario, trim: Trim) -> None:
    """The same of a diagnosis without a law: prediction, sensor monitor, statistical detector."""
    prediction, fdi, declared = frame["prediction"], frame["fdi"], Declared.of(scenario)
    design = prediction["design"]
    prediction["u"] = prediction["commanded"] = frame["control"]["layout"]["trim"] = trim.command
    servos = prediction["actuators"]
    for end, sign in (("u_lo", -1.0), ("u_hi", 1.0)):
        prediction[end] = np.clip(trim.command + sign * servos["band"], servos["low"], servos["high"])
    anchor(design, trim.x, trim.y, trim.u)
    configure_sensor_monitor(fdi["sensor_monitor"], declared, design, trim.y)
    configure_statistics(fdi, declared, design, (trim.x, trim.y, trim.u))


def _assemble_design(scenario: Scenario, travel: np.ndarray, line: int) -> np.ndarray:
    """The record of a design, made again."""
    aircraft, dt = scenario.airframe, 1.0 / scenario.rate_hz
    frames = taken_empty((1,), frame_dtype(aircraft.n, required_size(aircraft), line))
    frame, instant_s = frames[0], dt / scenario.substeps
    frame["dt"], frame["accounts"]["guarantee"]["certain_after_s"] = dt, -1.0
    truth, channels = frame["truth"], ch.truth_channels(aircraft)
    truth["n"], truth["declared"] = len(channels), len(aircraft.signals)
    truth["factor"][: len(channels)] = [factor for _, _, factor in channels]
    configure_instruments(frame["instruments"], scenario, instant_s)
    declared = Declared.of(scenario)
    model_prediction.configure_prediction(frame["prediction"], declared, travel)
    schemes.configure_diagnosis(frame["fdi"], frame["prediction"], declared, travel)
    control.configure(frame["control"], declared, travel)
    set_up_autopilot(frame["autopilot"], frame["control"], declared)
    return frames


def y_places(frame: np.void) -> list[int]:
    """Where in the truth the measured signals beside the rates are: y without noise, (4 + declared,)."""
    return ch.signal_places(frame["prediction"]["u"].size, int(frame["truth"]["declared"]))


def lay_out(frame: np.void, scenario: Scenario, diagnoses_itself: bool) -> tuple[str, ...]:
    """Note in a flight's record what there are columns for; returns their names."""
    fdi, logged, profile = frame["fdi"], frame["logged"], bool(frame["autopilot"]["enabled"])
    aircraft, tests = scenario.airframe, fdi["statistical"]["test"]
    estimators = estimator_names(scenario.fdi.fault_class, aircraft) if diagnoses_itself else ()
    logged["estimators"] = fdi["isolation"]["config"]["n_estimators"] if diagnoses_itself else 0
    # share, test, and which reading is missing
    watched = logged["sensor_monitor"] = 3 * are_ever_monitored(scenario)
    sampled = records_further(scenario)
    logged["sampled"] = N_SAMPLED if sampled else 0
    moved = frame["control"]["power"]["config"]["enabled"] or (profile and aircraft.airspeed_by == "power")
    moved |= bool(frame["control"]["engines"]["config"]["n"])
    power = aircraft.power_setting if moved else ""
    logged["power"] = 1 + len(aircraft.effectors) if power else 0
    logged["tests"] = tests["n_scores"] if tests["enabled"] else 0
    tested, columns = bool(tests["enabled"]), COLUMNS if profile else ()
    return ch.log_columns(aircraft, estimators, watched, power, columns, tested, sampled)
