"""The sensor monitor in flights by rotation matrices: faults named by hand and drawn at random; its rules."""

import numpy as np
import pytest
from kernels import fill, new_fdi
from true_flight import UNITS, new_monitor, true_flight

from beaver_ftc.diagnosis.model_prediction import move_healthy, move_surfaces, prediction_dtype
from beaver_ftc.diagnosis.monitors import gyro_or_attitude, sensor_monitor
from beaver_ftc.diagnosis.monitors.flow_or_force import FORCES
from beaver_ftc.diagnosis.monitors.gyro_or_attitude import GYRO_OPEN, GYRO_REFUTED
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    PRESSURE_TEST,
    PSI,
    RPM_TEST,
    SPEED_TEST,
    THETA,
    TURN_TEST,
)
from beaver_ftc.diagnosis.monitors.suspects import find_suspects, latch_exceeded
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    MEASURED,
    N_SENSORS,
    PHI,
    SENSORS,
)

H, N, FROM = 0.01, 200, 40
D = np.array([[4.0, 0.2, -0.3], [-0.2, 3.0, 0.0], [0.3, 0.1, 1.0]])


def flown(readings, true, missing=None, air=None, **fields):
    """The monitor after a flight; the readings (N, N_SENSORS) that the diagnosis is given, and whether it may
    use accelerometers (N,); suspects, cleared sensors, verdicts of gyros and unused readings (N, ...). The
    innovation has the errors of the gyros in it alone."""
    fdi, given, inertial, history = new_fdi(), [], [], []
    monitor = new_monitor(H, 0.02 * UNITS, 0.01 * UNITS, D=D, y_trim=true[0], **fields)
    fill(monitor, **air or {})
    n = monitor["config"]["substeps"]
    monitor["substep"] = n - 1
    fdi["bound"]["nu_max"] = fdi["bound"]["eta_bar"] = 0.2
    fdi["bank"]["output"]["threshold"] = 9.0
    measured, pred = (np.zeros(1, dtype).view(np.recarray)[0] for dtype in (MEASURED, prediction_dtype(4)))
    error = (readings - true)[:, :3]
    for k, y in enumerate(readings):
        measured["signal"], measured["force"], measured["inertial"] = y, y[AX : AX + 3], 1
        if missing is not None and k >= FROM:
            measured["missing"][missing] = 1
        if k % n == 0:
            past, now = error[max(k - n - 1, 0)], error[max(k - 1, 0)]
            fdi["bank"]["output"]["innovation"] = (now - past) / (n * H) + D @ past
        pred["f"] = (true[k, :3] - true[max(k - 1, 0), :3]) / H
        sensor_monitor.check_sensors(
            monitor, pred, measured, fdi["verdict"], fdi["bank"], fdi["bound"], n * H, k * H
        )
        given.append(measured["signal"].copy())
        inertial.append(int(measured["inertial"]))
        o = monitor["output"]
        history.append(
            np.concatenate(
                [
                    o["suspect"],
                    monitor["course"]["cleared"],
                    monitor["gyro"]["verdict"],
                    o["is_reading_unused"],
                ]
            )
        )
    return monitor, np.array(given), np.array(inertial), np.array(history)


def with_fault(seed, sensor, kind, size, first=FROM, noisy=False):
    """(readings, true) (N, N_SENSORS): sound noise, and this fault of a sensor from the sample `first` on."""
    rng, after = np.random.default_rng(seed), np.arange(N) >= first
    true = true_flight(rng, N, H)
    readings = true + 0.009 * UNITS * rng.uniform(-1.0, 1.0, true.shape)
    if not noisy:
        readings[:, PHI : PHI + 3] = true[:, PHI : PHI + 3]
    y, e = readings[:, sensor], size * UNITS[sensor]
    if kind == "jump":
        y += e * after
    elif kind == "scale":
        y += size * y * after
    elif kind == "noise":
        y += e * after * rng.normal(size=N)
    elif kind == "ramp":
        y += e * after * (np.arange(N) - first) * H
    elif kind == "frozen":
        y[after] = y[first]
    return readings, true


NAMED = [
    ("p", "jump", 10), ("q", "jump", -10), ("r", "jump", 10), ("q", "scale", -1), ("r", "noise", 20),
    ("alpha", "jump", 15), ("alpha", "noise", 20), ("beta", "jump", -15), ("beta", "noise", 20),
    ("V", "jump", 8), ("V", "scale", 0.3), ("qdyn", "scale", 0.2), ("qdyn", "noise", 10),
    ("phi", "jump", 20), ("theta", "jump", -20), ("psi", "jump", 20), ("theta", "frozen", 0),
    ("altitude", "jump", 10), ("altitude", "noise", 10), ("engine_rpm", "jump", 9),
    ("manifold_pressure", "jump", 9), ("az", "jump", 40), ("ax", "jump", 60),
]  # fmt: skip


@pytest.mark.parametrize(("name", "kind", "size"), NAMED)
def test_a_broken_sensor_is_isolated_and_its_reading_replaced(name, kind, size):
    i = SENSORS.index(name)
    readings, true = with_fault(7, i, kind, size)
    monitor, given, inertial, _ = flown(readings, true)
    output = monitor["output"]
    assert output["alarmed"]
    assert output["isolated_sensor"] == i, [SENSORS[s] for s in np.flatnonzero(output["suspect"])]
    k = round(output["isolated_at_s"] / H)
    assert FROM <= k < N
    assert np.flatnonzero(output["is_reading_unused"]).tolist() == [i]
    assert (np.delete(given, i, axis=1) == np.delete(readings, i, axis=1)).all()
    if i < AX:
        assert abs(given[k:, i] - true[k:, i]).max() < 8.0 * UNITS[i]
    assert inertial[k:].any() == (i < AX)


def test_a_replaced_rate_changes_by_the_surfaces_in_the_sample_before():
    """Inside a frame, too, where a servo has moved them on since."""
    pred = np.zeros(1, prediction_dtype(4)).view(np.recarray)[0]
    fill(pred["actuators"], real=1, approach=0.5, step=1.0, low=-1.0, high=1.0)
    pred["G"] = 1.0
    move_surfaces(pred, np.full(4, 0.2))
    move_healthy(pred)
    rate = sensor_monitor.estimate_rate(new_monitor(H, substep=1), pred, 0)
    assert rate == pytest.approx(0.4 * H)


def with_ratios(ratios, **fields):
    """Tests {test: ratio}, of which the residual is as large; in level flight, where each angle turns the
    aircraft about one axis. Other bounds are 1."""
    monitor = new_monitor(H, **fields)
    tests = monitor["tests"]
    tests["B"] = 1.0
    for j, ratio in ratios.items():
        tests["ratio"][j], tests["r"][j] = ratio, ratio
    monitor["angle"]["c_max"] = np.eye(3)
    turns, angles = tests["r"][TURN_TEST:][:3], tests["r"][ANGLE_TEST:][:3]
    monitor["angle"]["beyond"] = turns - np.eye(3)[..., None] * angles[:, None]
    return monitor


def suspects(ratios, alarm=None, **fields):
    """The sensors that can have brought the tests here."""
    monitor = with_ratios(ratios, **fields)
    monitor["output"]["alarm_test"] = max(ratios, key=ratios.get) if alarm is None else alarm
    latch_exceeded(monitor)
    find_suspects(monitor)
    return set(np.flatnonzero(monitor["output"]["suspect"]).tolist())


@pytest.mark.parametrize(
    ("ratios", "who"),
    [
        ({SPEED_TEST: 2.0}, {I_AIRSPEED, *FORCES}),
        ({DENSITY_TEST: 3.0, SPEED_TEST: 2.0}, {I_AIRSPEED}),
        ({CLIMB_TEST: 2.0}, {ALTITUDE}),
        ({CLIMB_TEST: 3.0, SPEED_TEST: 2.0}, set()),  # the altitude is in no other test
        ({DENSITY_TEST: 3.0, CLIMB_TEST: 2.0}, {I_AIRSPEED}),  # nor is the dynamic pressure
        ({RPM_TEST: 2.0}, {ENGINE_SPEED}),
        ({PRESSURE_TEST: 2.0}, {MANIFOLD}),
        ({ALPHA_TEST: 5.0}, {I_ALPHA, *FORCES}),
        ({BETA_TEST: 5.0}, {I_BETA, *FORCES}),
        ({ALPHA_TEST: 2.0}, {I_ALPHA, 1, *FORCES}),  # its gyro need not show yet: within twice both bounds
        ({BETA_TEST: 2.0}, {I_BETA, 2, *FORCES}),
        ({ALPHA_TEST: 5.0, TURN_TEST + 1: 2.0}, {1}),
        ({BETA_TEST: 5.0, TURN_TEST + 2: 2.0}, {2}),
        ({BETA_TEST: 5.0, TURN_TEST: 2.0}, {0}),  # no sensor of the flow moves the attitude's tests
        ({ALPHA_TEST: 5.0, TURN_TEST: 2.0, TURN_TEST + 1: 1.5}, set()),
        ({TURN_TEST: 2.1}, {0}),
        ({TURN_TEST + 2: 2.1}, {2}),
        ({TURN_TEST: 1.9}, {0, PHI}),  # the angle's own test may hide as much: both bounds together
        ({TURN_TEST + 1: 2.0, ANGLE_TEST + 1: 1.5}, {1, THETA}),
        ({TURN_TEST: 2.0, TURN_TEST + 1: 1.5}, set()),
        ({ANGLE_TEST + 2: 2.0}, {0, 1, 2, PSI}),  # an angle alone may be the first to show what a gyro does
        ({ANGLE_TEST: 2.0, ANGLE_TEST + 2: 1.5}, {0, 1, 2}),
        ({TURN_TEST: 100.0, TURN_TEST + 1: 2.9}, {0}),  # a large error moves its neighbours a little
        ({TURN_TEST: 100.0, TURN_TEST + 1: 3.1}, set()),
        ({ANGLE_TEST: 100.0, ANGLE_TEST + 1: 2.9}, {0, 1, 2, PHI}),
        ({TURN_TEST + 2: 100.0, ANGLE_TEST: 2.0}, {2, PHI}),  # angles are compared with angles
    ],
)
def test_who_is_suspected_of_what_the_tests_show(ratios, who):
    assert suspects(ratios) == who


@pytest.mark.parametrize(
    ("peak", "noise", "verdict"),
    [
        (0.0, 0.0, GYRO_REFUTED), (0.004, 0.0, GYRO_OPEN), (0.0, 0.6, GYRO_OPEN), (0.0, 0.4, GYRO_REFUTED),
    ],
)  # fmt: skip
def test_an_error_of_the_attitude_that_has_shown_and_is_gone_is_no_gyros(peak, noise, verdict):
    """Two frames ago the first gyro's error has shown as 1 rad/s; the noise of the attitude in rad/s."""
    monitor, fdi = new_monitor(H, W_max=1.0), new_fdi()
    gyro = monitor["gyro"]
    gyro["most_older"][0], gyro["most_past"][0] = 1.0, peak
    monitor["tests"]["per_sample"], fdi["bound"]["nu_max"] = noise * H / 4.0, 1.0
    fdi["bank"]["output"]["threshold"][:3] = 1.0
    gyro_or_attitude.judge_gyros(monitor, fdi["bank"], fdi["bound"], 0.02)
    assert gyro["verdict"][0] == verdict


KEPT_MEMORY = {"tests": "exceeded", "course": "cleared", "dynamics": "gyros_excluded"}
KINDS = ("jump", "jump", "scale", "noise", "ramp", "frozen", "missing")


@pytest.mark.parametrize("i", range(N_SENSORS), ids=SENSORS)
def test_faults_drawn_at_random_end_as_kept(i, changed):
    """Sizes and instants, with and without noise of the attitude, gusts and several samples a frame."""
    kept = []
    for n, kind in enumerate(KINDS):
        rng = np.random.default_rng([i, n])
        noisy, slow, gusty, turns = (rng.random(4) < 0.4).tolist()
        size, first = rng.choice([-1, 1]) * 10 ** rng.uniform(0, 2), int(rng.choice([0, 3, FROM]))
        readings, true = with_fault(i, i, kind, size / 40 if kind == "scale" else size, first, noisy)
        air = {"gust_max": 3.0, "gust_change": (0.1, 0.3, 1.0), "low_m": 500.0} if gusty else {}
        fields = {"noisy": noisy, "substeps": 1 + 3 * slow, "turn_max": 0.01 * turns}
        missing = i if kind == "missing" else None
        monitor, given, inertial, history = flown(readings[:90], true[:90], missing, air, **fields)
        output = monitor["output"]
        results = {name: output[name] for name in output.dtype.names}
        results |= {name: monitor[part][name] for part, name in KEPT_MEMORY.items()}
        results |= {"w_bound": monitor["dynamics"]["W_max"], "gyro_verdict": monitor["gyro"]["verdict"]}
        initial = monitor["initial"]
        results |= {
            "B": monitor["tests"]["B"],
            "initial": initial["E"],
            "refuted": initial["refuted"].sum(axis=1),
        }
        results |= {"given": given.mean(axis=0), "inertial": inertial.sum(), "history": history.sum(axis=0)}
        kept.append(results)
    assert not changed(kept)
