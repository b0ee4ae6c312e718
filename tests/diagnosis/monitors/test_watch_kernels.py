"""The monitor over the instruments a decision at a time: who is suspected, who named, what stands in."""

from itertools import product

import numpy as np
import pytest
from kernels import DT, fill, new_fdi, on

from beaver_ftc.design.model import DPT, measured_slipstream
from beaver_ftc.diagnosis.detection import attitude
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.diagnosis.monitors import (
    ENGINE_MONITOR_RECORD,
    detect_engine_failure,
    disable_if_apart,
)
from beaver_ftc.diagnosis.monitors import redundancy as relations
from beaver_ftc.diagnosis.monitors import sensor_monitor as watching
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    ALPHA,
    ALPHA_TEST,
    ANGLE_TEST,
    BETA,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    GYRO_CONFIRMED,
    GYRO_OPEN,
    GYRO_REFUTED,
    N_TESTS,
    NO_SENSOR,
    PRESSURE_TEST,
    PSI,
    QDYN,
    RPM_TEST,
    SENSOR_MONITOR_RECORD,
    SPEED_TEST,
    THETA,
    TURN_TEST,
)
from beaver_ftc.diagnosis.schemes import adaptive_estimators
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED, YAW
from beaver_ftc.loop import frame
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

H = 0.005
MISSING = np.dtype([("missing", "i8", (N_SENSORS,)), ("signal", "f8", (N_SENSORS,))], align=True)
GYROS, FORCES = (0, 1, 2), (AX, AX + 1, AX + 2)


def new_watch(**fields):
    monitor = np.zeros(1, SENSOR_MONITOR_RECORD).view(np.recarray)[0]
    (
        monitor["config"]["enabled"],
        monitor["config"]["substeps"],
        monitor["output"]["isolated_sensor"],
        monitor["config"]["rate_gain"],
    ) = 1, 4, NO_SENSOR, 1.0
    (
        monitor["redundancy"]["config"]["sample_time_s"],
        monitor["redundancy"]["config"]["decay"],
        monitor["output"]["alarmed_at_s"],
    ) = (
        H,
        (0.0, 0.9, 0.99),
        -1.0,
    )
    (
        monitor["redundancy"]["test"]["B"],
        monitor["config"]["n_frozen"],
        monitor["redundancy"]["config"]["max_airspeed_mps"],
    ) = (
        1.0,
        3,
        80.0,
    )
    return fill(monitor, **fields)


def seen(*missing):
    measured = np.zeros(1, MISSING).view(np.recarray)[0]
    measured["missing"][list(missing)] = 1
    return measured


def with_shares(shares, **fields):
    """Tests {test: share of its bound}, of which the residual is as large; in level flight, where each angle
    turns the aircraft about one axis."""
    monitor = new_watch(**fields)
    residuals = monitor["redundancy"]["test"]["r"]
    for test, share in shares.items():
        monitor["redundancy"]["test"]["ratio"][test] = share
        residuals[test] = share
    turns, angles = residuals[TURN_TEST:][:3], residuals[ANGLE_TEST:][:3]
    monitor["memory"]["c_max"] = np.eye(3)
    for i in range(3):
        monitor["memory"]["beyond"][i] = turns - np.eye(3)[i][:, None] * angles[i]
    return monitor


@pytest.mark.parametrize(
    ("shares", "substep", "farthest"),
    [({}, 0, (0, 0.0)), ({3: 1.1, 7: 1.3, 9: 1.2}, 0, (7, 1.3)), ({0: 2.0}, 0, (0, 2.0)),
     ({12: 2.0}, 1, (12, 2.0)), ({3: 0.4}, 1, (5, 0.7)), ({3: 0.4}, 0, (3, 0.4))],
)  # fmt: skip
def test_of_the_looks_of_a_frame_the_test_farthest_towards_its_bound_is_kept(shares, substep, farthest):
    monitor = with_shares(shares, worst_test_index=5, top_ratio=0.7, substep=substep)
    watching.find_worst(monitor)
    assert (
        monitor["output"]["worst_test_index"],
        monitor["output"]["top_ratio"],
    ) == farthest


def suspects(shares, lead=None, **fields):
    """Who can have brought the tests here."""
    monitor = with_shares(shares, **fields)
    monitor["output"]["alarm_test"] = max(shares, key=shares.get) if lead is None else lead
    watching.latch_exceeded(monitor)
    watching.find_suspects(monitor)
    return set(np.flatnonzero(monitor["output"]["suspect"]).tolist())


@pytest.mark.parametrize(
    ("shares", "who"),
    [
        ({SPEED_TEST: 2.0}, {AIRSPEED, *FORCES}),
        ({DENSITY_TEST: 3.0, SPEED_TEST: 2.0}, {AIRSPEED}),
        ({CLIMB_TEST: 2.0}, {ALTITUDE}),
        ({CLIMB_TEST: 3.0, SPEED_TEST: 2.0}, set()),  # the altitude is in no other test
        ({DENSITY_TEST: 3.0, CLIMB_TEST: 2.0}, {AIRSPEED}),  # nor is the dynamic pressure
        ({RPM_TEST: 2.0}, {ENGINE_SPEED}),
        ({PRESSURE_TEST: 2.0}, {MANIFOLD}),
        ({ALPHA_TEST: 5.0}, {ALPHA, *FORCES}),
        ({BETA_TEST: 5.0}, {BETA, *FORCES}),
        ({ALPHA_TEST: 2.0}, {ALPHA, 1, *FORCES}),  # its gyro need not show yet: within twice both bounds
        ({BETA_TEST: 2.0}, {BETA, 2, *FORCES}),
        ({ALPHA_TEST: 5.0, TURN_TEST + 1: 2.0}, {1}),
        ({BETA_TEST: 5.0, TURN_TEST + 2: 2.0}, {2}),
        (
            {BETA_TEST: 5.0, TURN_TEST: 2.0},
            {0},
        ),  # no instrument of the flow moves the attitude's tests
        ({ALPHA_TEST: 5.0, TURN_TEST: 2.0, TURN_TEST + 1: 1.5}, set()),
        ({TURN_TEST: 2.1}, {0}),
        ({TURN_TEST + 2: 2.1}, {2}),
        ({TURN_TEST: 1.9}, {0, PHI}),  # the angle's own test may hide as much: both bounds together
        ({TURN_TEST + 1: 1.9}, {1, THETA}),
        ({TURN_TEST + 1: 2.0, ANGLE_TEST + 1: 1.5}, {1, THETA}),
        ({TURN_TEST: 2.0, TURN_TEST + 1: 1.5}, set()),
        (
            {ANGLE_TEST + 2: 2.0},
            {0, 1, 2, PSI},
        ),  # an angle alone may be the first to show what a gyro does
        ({ANGLE_TEST: 2.0, ANGLE_TEST + 2: 1.5}, {0, 1, 2}),
    ],
)
def test_who_is_suspected_of_what_the_tests_show(shares, who):
    assert suspects(shares) == who


@pytest.mark.parametrize("wrong", range(3))
def test_the_error_of_one_angle_leaves_nothing_beyond_it(wrong):
    """Of random attitudes the reading of one angle is off by random steps: nothing is left beyond that angle,
    but beyond the others; the sizes of its residuals add up."""
    rng = np.random.default_rng(wrong)
    monitor, readings, size = new_watch(), np.zeros(N_SENSORS), 0.0
    redundancy = monitor["redundancy"]
    redundancy["config"]["decay"] = 1.0
    readings[AIRSPEED], redundancy["memory"]["y_past"][AIRSPEED] = 45.0, 45.0
    for _ in range(20):
        attitude, step = rng.uniform((-3, -1.2, -3), (3, 1.2, 3)), rng.uniform(-1e-3, 1e-3)
        redundancy["memory"]["predicted_reading"][PHI : PHI + 3] = attitude
        q = relations.attitude(redundancy["memory"]["predicted_reading"])
        readings[PHI : PHI + 3] = attitude + step * (np.arange(3) == wrong)
        relations.fill_residuals(redundancy, readings, q)
        watching.filter_beyond(monitor, readings)
        size += abs(step)
    beyond = abs(monitor["memory"]["beyond"]).max(axis=(1, 2))
    assert (beyond < 1e-8).tolist() == [i == wrong for i in range(3)]
    sizes = monitor["memory"]["swing"]
    assert sizes[wrong] == pytest.approx(size, rel=1e-9)
    assert abs(np.delete(sizes, wrong, axis=0)).max() < 1e-12


def test_an_angle_that_has_turned_an_axis_before_is_still_suspected():
    """In level flight a heading turns the yaw axis alone. The filters still have what it turned the roll axis
    by in a steeper attitude, at most 0.5 of the heading."""
    shares = {TURN_TEST: 5.0, TURN_TEST + 2: 9.0, ANGLE_TEST + 2: 9.0}
    monitor = with_shares(shares)
    watching.latch_exceeded(monitor)
    monitor["memory"]["c_max"][2, 0] = 0.5
    for beyond, explains in ((5.0, False), (1.6, False), (1.4, True), (-1.4, True), (-1.6, False)):
        monitor["memory"]["beyond"][2, 0] = beyond
        assert watching.explains_turns(monitor, 2) == explains
    monitor["redundancy"]["memory"]["reading_bound"][PHI] = 0.1
    monitor["memory"]["beyond"][2, 0] = 1.9
    for size, explains in ((3.9, False), (4.1, True)):  # 1.5 and a tenth of the size
        monitor["memory"]["swing"][2] = size
        assert watching.explains_turns(monitor, 2) == explains
    monitor["memory"]["beyond"][2, 2] = 1e3
    for turn, explains in ((11.9, True), (-12.1, False)):  # 1.1 times the 10 of the angle, and the bound 1
        monitor["redundancy"]["test"]["r"][TURN_TEST + 2] = turn
        assert watching.explains_turns(monitor, 2) == explains


def test_an_angle_that_is_frozen_is_no_gyro_s_doing():
    shares, still = {TURN_TEST + 1: 2.0, ANGLE_TEST + 1: 1.5}, np.zeros(N_SENSORS, int)
    for looks, who in ((2, {1, THETA}), (3, {THETA})):
        still[THETA] = looks
        assert suspects(shares, n_same=still) == who
    assert suspects({TURN_TEST: 2.1}, n_same=still) == set()


def test_a_large_error_moves_its_neighbours_a_little():
    """What is below a share of the largest of its kind is beyond its bound for a neighbour's sake."""
    assert suspects({TURN_TEST: 100.0, TURN_TEST + 1: 2.9}) == {0}
    assert suspects({TURN_TEST: 100.0, TURN_TEST + 1: 3.1}) == set()
    assert suspects({ANGLE_TEST: 100.0, ANGLE_TEST + 1: 2.9}) == {0, 1, 2, PHI}


@pytest.mark.parametrize(
    ("airspeed", "who"), [(10.0, {AIRSPEED, QDYN}), (1.0, {AIRSPEED, QDYN}), (50.0, {QDYN})]
)
def test_an_airspeed_as_wrong_as_the_density_has_it_would_show_in_its_own_test(airspeed, who):
    """0.5 V ln(density ratio) against twice the bound of the airspeed's test, 2."""
    monitor = with_shares({DENSITY_TEST: 0.2})
    monitor["redundancy"]["test"]["ratio"][DENSITY_TEST] = 2.0
    monitor["redundancy"]["memory"]["y_past"][AIRSPEED], monitor["output"]["alarm_test"] = (
        airspeed,
        DENSITY_TEST,
    )
    monitor["initial_errors"]["refuted"] = 1
    assert watching.speed_contradicts(monitor) == (who == {QDYN})
    watching.find_suspects(monitor)
    assert set(np.flatnonzero(monitor["output"]["suspect"]).tolist()) == who
    monitor["memory"]["n_same"][AIRSPEED] = 1
    watching.find_suspects(monitor)
    assert monitor["output"]["suspect"][AIRSPEED], "one that stands still may be frozen"


@pytest.mark.parametrize(
    ("say", "who"),
    [(GYRO_OPEN, {1, THETA}), (GYRO_CONFIRMED, {1}), (GYRO_REFUTED, {THETA})],
)
def test_the_rates_decide_between_a_gyro_and_the_attitude(say, who):
    assert (
        suspects(
            {TURN_TEST + 1: 2.0, ANGLE_TEST + 1: 1.5},
            gyro_verdict=(GYRO_OPEN, say, GYRO_OPEN),
        )
        == who
    )


def test_an_angle_shows_what_the_axis_farthest_beyond_its_bound_does():
    monitor = with_shares({TURN_TEST: 0.2, TURN_TEST + 1: 0.5, TURN_TEST + 2: 0.3})
    assert [watching.worst_turn_axis(monitor, i) for i in range(3)] == [1, 1, 1]
    monitor = with_shares({TURN_TEST: 0.5, TURN_TEST + 1: 0.5, TURN_TEST + 2: 0.5})
    assert [watching.worst_turn_axis(monitor, i) for i in range(3)] == [0, 1, 2]


@pytest.mark.parametrize("known", [0, 1])
@pytest.mark.parametrize("gyros_excluded", [0, 1])
@pytest.mark.parametrize("noisy", [0, 1])
def test_a_surface_may_be_named_where_no_gyro_can_be_it(known, gyros_excluded, noisy):
    fields = {"gyros_excluded": gyros_excluded, "noisy": noisy}
    assert watching.allows_isolation(new_watch(enabled=0, **fields), known)
    clear = bool(known and (gyros_excluded or not noisy))
    assert bool(watching.allows_isolation(new_watch(**fields), known)) == clear


@pytest.mark.parametrize(("detected_at_s", "early"), [(2.5, True), (3.49, True), (3.51, False)])
def test_an_alarm_of_the_first_second_may_be_an_instruments_first_error(detected_at_s, early):
    assert watching.may_be_initial(new_watch(t_start=2.5), detected_at_s) == early
    assert not watching.may_be_initial(new_watch(enabled=0, t_start=2.5), detected_at_s)


@pytest.mark.parametrize(
    ("flow", "gyro", "share"),
    [(ALPHA_TEST, 0, np.tan(0.3) * np.cos(0.2)), (ALPHA_TEST, 1, 1.0),
     (ALPHA_TEST, 2, np.tan(0.3) * np.sin(0.2)), (BETA_TEST, 0, np.sin(0.2)), (BETA_TEST, 1,
     0.0),
     (BETA_TEST, 2, 1.0)],
)  # fmt: skip
@pytest.mark.parametrize("less", [0.99, 1.01])
def test_how_much_of_the_flow_a_gyro_may_move_unseen(flow, gyro, share, less):
    """Twice what its own test leaves, by the kinematics of a flow at 0.2 rad and -0.3 rad."""
    monitor = new_watch()
    monitor["redundancy"]["memory"]["y_past"][[ALPHA, BETA]] = 0.2, -0.3
    monitor["redundancy"]["test"]["B"][TURN_TEST + gyro] = 40.0
    own = (flow, gyro) in ((ALPHA_TEST, 1), (BETA_TEST, 2))
    monitor["redundancy"]["test"]["r"][flow] = -less * (80.0 * share + (2.0 if own else 1.0))
    assert watching.gyro_hidden(monitor, flow, gyro, own) == (less < 1.0 and share > 0.0)


@pytest.mark.parametrize("name", ["alpha", "beta", "V", "qdyn"])
def test_no_surface_is_named_while_a_reading_of_the_flow_stands_still(name):
    """Whatever moves the aircraft moves it; but a sideslip of zero may stay one."""
    i = SENSORS.index(name)
    monitor = new_watch(noisy=0)
    monitor["config"]["n_frozen"], monitor["redundancy"]["memory"]["y_past"] = 3, 0.1
    for still, value, clear in ((2, 0.1, True), (3, 0.1, False), (3, 0.0, True)):
        (
            monitor["memory"]["n_same"][i],
            monitor["redundancy"]["memory"]["y_past"][i],
        ) = still, value
        assert bool(watching.allows_isolation(monitor, 1)) == clear
    (
        monitor["redundancy"]["memory"]["y_past"],
        monitor["memory"]["n_same"],
        monitor["memory"]["n_same"][0],
    ) = (
        0.1,
        0,
        9,
    )
    assert watching.allows_isolation(monitor, 1), "a gyro is held against the attitude"


def test_the_watch_has_the_word_once_it_has_raised_its_alarm():
    words = [bool(watching.has_alarm(new_watch(enabled=e, alarmed=a))) for e in (0, 1) for a in (0, 1)]
    assert words == [False, False, False, True]


def detected_fdi(at_s=-1.0, isolated=NOT_ISOLATED):
    fdi = new_fdi()
    verdict = fdi["verdict"]
    verdict["detected"], verdict["detected_at_s"], verdict["isolated_estimator"] = at_s >= 0.0, at_s, isolated
    (
        verdict["isolated_at_s"],
        verdict["fault_type"],
        verdict["target"],
        verdict["accommodation_mode"],
    ) = at_s, 2, 1, 1
    fdi["types"]["surface"]["accommodation"]["mode"] = 1
    fdi["fdae"]["network"]["memory"]["weights"] = fdi["fdae"]["network"]["output"] = 0.3
    return fdi


@pytest.mark.parametrize("isolated", [NOT_ISOLATED, 0, 1])
def test_an_alarm_voids_what_a_moment_ago_was_made_of_it(isolated):
    monitor, fdi = new_watch(), detected_fdi(9.6, isolated)
    on(watching.raise_alarm, fdi, monitor, 10.0)
    assert monitor["output"]["alarmed"]
    assert monitor["output"]["alarmed_at_s"] == 9.6  # the same fault, seen first in the rates
    assert monitor["output"]["had_surface"] == (isolated >= 0)
    assert not monitor["output"]["keeps_surface"]
    frame.reset_surface_diagnosis(fdi)
    verdict = fdi["verdict"]
    assert [verdict[name] for name in ("detected", "isolated_estimator", "fault_type")] == [
        0,
        NOT_ISOLATED,
        -1,
    ]
    assert [verdict[name] for name in ("detected_at_s", "isolated_at_s")] == [-1.0, -1.0]
    assert [verdict[name] for name in ("target", "accommodation_mode")] == [-1, -1]
    assert (fdi["types"]["surface"]["accommodation"]["mode"] == -1).all()
    assert not fdi["fdae"]["network"]["memory"]["weights"].any()
    assert not fdi["fdae"]["network"]["output"].any()
    on(watching.raise_alarm, detected_fdi(9.6, 1), monitor, 11.0)
    assert monitor["output"]["alarmed_at_s"] == 9.6


def test_a_surface_found_long_before_stays_found():
    monitor, fdi = new_watch(), detected_fdi(9.4, 1)
    on(watching.raise_alarm, fdi, monitor, 10.0)
    assert monitor["output"]["keeps_surface"]
    assert monitor["output"]["alarmed_at_s"] == 10.0
    assert fdi["verdict"]["isolated_estimator"] == 1
    monitor, fdi = new_watch(), detected_fdi(9.5, 1)
    on(watching.raise_alarm, fdi, monitor, 10.0)  # half a second is no long time
    assert not monitor["output"]["keeps_surface"]


def test_with_nothing_found_before_the_alarm_is_of_now():
    monitor, fdi = new_watch(), detected_fdi()
    on(watching.raise_alarm, fdi, monitor, 10.0)
    assert monitor["output"]["alarmed_at_s"] == 10.0
    assert not monitor["output"]["keeps_surface"]
    assert not monitor["output"]["had_surface"]


def test_an_instrument_without_a_reading_is_named_at_once():
    monitor = new_watch()
    on(watching.isolate_sensor, new_fdi(), monitor, seen(BETA, PSI), 5.0)
    assert monitor["output"]["alarmed"]
    assert monitor["output"]["isolated_sensor"] == BETA
    assert monitor["output"]["isolated_at_s"] == 5.0
    assert np.flatnonzero(monitor["output"]["is_reading_unused"]).tolist() == [BETA]
    on(watching.isolate_sensor, new_fdi(), monitor, seen(PSI), 6.0)
    assert monitor["output"]["isolated_sensor"] == BETA


def alarm_and_sensor(monitor):
    """(whether there is an alarm, the test that raised it, the sensor that is named)."""
    return tuple(monitor["output"][name] for name in ("alarmed", "alarm_test", "isolated_sensor"))


def test_the_one_suspect_left_is_named_and_two_are_not():
    monitor = with_shares({CLIMB_TEST: 2.0})
    on(watching.isolate_sensor, new_fdi(), monitor, seen(), 5.0)
    assert alarm_and_sensor(monitor) == (1, CLIMB_TEST, ALTITUDE)
    monitor = with_shares({ALPHA_TEST: 2.0})
    on(watching.isolate_sensor, new_fdi(), monitor, seen(), 5.0)
    assert alarm_and_sensor(monitor) == (1, ALPHA_TEST, NO_SENSOR)
    monitor["redundancy"]["test"]["ratio"][SPEED_TEST] = 9.0
    on(watching.isolate_sensor, new_fdi(), monitor, seen(), 6.0)
    assert monitor["output"]["alarm_test"] == ALPHA_TEST  # the first alarm leads
    quiet = new_watch()
    on(watching.isolate_sensor, new_fdi(), quiet, seen(), 5.0)
    assert not quiet["output"]["alarmed"]


def asked(
    error=(0.0, 0.0, 0.0), then=(0.0, 0.0, 0.0), innovation=(0.0, 0.0, 0.0), noise=0.0, spike=0.0, **fields
):
    """What the rates say by axis; by default the bound of a frame is 1 rad/s2."""
    monitor, fdi = (
        new_watch(
            w_att=error,
            w_att_past=then,
            peak_older=spike,
            **fields,
        ),
        new_fdi(),
    )
    fdi["bank"]["output"]["innovation"], fdi["bound"]["nu_max"] = innovation, 1.0
    fdi["bank"]["output"]["threshold"][:3] = 1.0
    monitor["redundancy"]["test"]["bound_per_sample"] = noise
    on(watching.judge_gyros, fdi, monitor)
    return monitor["memory"]["gyro_verdict"].tolist()


def test_a_jump_of_a_gyro_is_an_acceleration_and_one_of_the_attitude_is_none():
    jump = 0.3 / DT
    assert asked(error=(0.3, 0, 0), innovation=(jump, 0, 0)) == [
        GYRO_CONFIRMED,
        GYRO_OPEN,
        GYRO_OPEN,
    ]
    assert asked(error=(0, 0.3, 0), innovation=(0, 0, 0)) == [
        GYRO_OPEN,
        GYRO_REFUTED,
        GYRO_OPEN,
    ]
    assert asked(error=(0, 0.3, 0), innovation=(0, -jump, 0)) == [
        GYRO_OPEN,
        GYRO_REFUTED,
        GYRO_OPEN,
    ]
    assert asked(
        error=(0.3, 0, 0),
        then=(0.3, 0, 0),
        w=(0.3, 0, 0),
        w_bound=(0.1, 1, 1),
    ) == [
        GYRO_CONFIRMED,
        GYRO_OPEN,
        GYRO_OPEN,
    ]


@pytest.mark.parametrize(
    ("floor", "peak", "noise", "say"),
    [
        (0.05, 0.2, 0.0, GYRO_OPEN),  # there in every sample, and it varies
        (0.05, 0.0549, 0.0, GYRO_REFUTED),  # it is steady
        (0.0, 0.2, 0.0, GYRO_REFUTED),  # it was not there in one sample
        (0.05, 0.2, 0.06 * H / 4.0, GYRO_REFUTED),  # all may be the attitude's noise
    ],
)
def test_an_error_that_varies_within_a_frame_has_no_jump_to_be_compared(floor, peak, noise, say):
    """By chance it is small in the two samples that are compared, while the rates show a jump of 5 rad/s2."""
    shown = {"floor_past": floor, "peak_past": peak}
    small = {"error": (0.0016, 0, 0), "then": (-0.0012, 0, 0), "innovation": (9.0, 0, 0), "noise": noise}
    assert asked(**small, **shown)[0] == say


@pytest.mark.parametrize(("less", "say"), [(0.999, GYRO_OPEN), (1.001, GYRO_REFUTED)])
def test_how_much_an_own_error_may_explain(less, say):
    """Of a jump a tenth, of the error ten per second, twice four noises a frame, and the bound of it."""
    jump, noise = 0.02 / DT, 1e-5
    own = 10.0 * 0.02 + 0.1 * jump
    blur = 4.0 * noise / H
    off = less * (1.0 + own + blur / DT)
    say_ = asked(
        error=(0.02, 0, 0),
        innovation=(jump - off, 0, 0),
        noise=noise,
        w_bound=(9, 9, 9),
        w=(0, 0, 0),
    )
    assert (say_[0] == GYRO_REFUTED) == (say == GYRO_REFUTED)


@pytest.mark.parametrize(("error", "say"), [(0.0029, GYRO_REFUTED), (0.0031, GYRO_OPEN)])
def test_what_has_shown_and_is_gone_is_no_gyros(error, say):
    assert asked(error=(error, 0, 0), then=(error, 0, 0), spike=1.0, w_bound=(1, 1, 1))[0] == say


def test_a_spike_within_the_attitudes_noise_says_nothing():
    noise = 0.6 * H / 4.0  # a blur of 0.6: below half of which a spike of 1 is none
    assert asked(spike=1.0, noise=noise, w_bound=(1, 1, 1))[0] == GYRO_OPEN
    assert asked(spike=1.21, noise=noise, w_bound=(1, 1, 1))[0] == GYRO_REFUTED


@pytest.mark.parametrize(("error", "say"), [(0.99, GYRO_OPEN), (1.01, GYRO_REFUTED)])
def test_a_gyros_error_stays_within_what_the_filter_may_have_of_it(error, say):
    error = error * (0.5 + 0.2 + 4.0 * 1e-4 / H) / 0.7
    assert (
        asked(
            error=(error,) * 3,
            then=(error,) * 3,
            w=(-0.2,) * 3,
            w_bound=(0.5,) * 3,
            noise=1e-4,
        )
        == [say] * 3
    )


def test_what_the_rates_have_said_stays_said():
    assert asked(
        error=(0, 0.3, 0),
        gyro_verdict=(GYRO_CONFIRMED, GYRO_CONFIRMED, GYRO_REFUTED),
    ) == [
        GYRO_CONFIRMED,
        GYRO_CONFIRMED,
        GYRO_REFUTED,
    ]


@pytest.mark.parametrize(("first", "say"), [(1.0, GYRO_OPEN), (0.5, GYRO_OPEN), (0.2, GYRO_REFUTED)])
def test_a_first_error_of_a_gyro_need_not_be_in_the_filter(first, say):
    """An error there from the first look on, which brought no innovation: 0.7 of it is within the bound."""
    monitor = new_watch(stage=1, substep=0, w_att=(first, -first, 2.0 * first))
    for substep in (0, 1, 2, 3):
        monitor["memory"]["substep"] = substep
        watching.advance_stage(monitor)
    assert monitor["memory"]["stage"] == 2
    assert monitor["memory"]["w_bound"].tolist() == [first, first, 2.0 * first], (
        "once, at the first look of the frame"
    )
    error = (0.7, -0.7, 1.4)
    assert asked(error=error, then=error, w_bound=monitor["memory"]["w_bound"])[0] == say


@pytest.mark.parametrize(("begun", "asked"), [(1, False), (2, False), (3, True)])
def test_the_first_whole_frame_shows_no_jump(begun, asked):
    monitor, fdi = (
        with_shares(
            {TURN_TEST: 2.0, ANGLE_TEST: 1.5},
            substep=0,
            w_att=(0, 0.3, 0),
            stage=begun,
        ),
        new_fdi(),
    )
    fdi["bank"]["output"]["threshold"], fdi["bound"]["nu_max"] = 1.0, 1.0
    on(watching.isolate_sensor, fdi, monitor, seen(), 5.0)
    assert (monitor["memory"]["gyro_verdict"][1] == GYRO_REFUTED) == asked


@pytest.mark.parametrize("quiet", ["error", "then", "peak_past"])
def test_what_comes_again_within_a_frame_is_not_gone(quiet):
    given = {"error": (0, 0, 0), "then": (0, 0, 0), "peak_past": 0.0}
    assert asked(spike=1.0, w_bound=(1, 1, 1), **given)[0] == GYRO_REFUTED
    given[quiet] = 0.004 if quiet == "peak_past" else (0.004, 0, 0)
    assert asked(spike=1.0, w_bound=(1, 1, 1), **given)[0] == GYRO_OPEN


def test_the_filter_of_a_gyros_error_follows_it_exactly():
    """W' = -D W + nu with nu = e' + D e, for an e of any course; and the bound of its own uncertainty."""
    rng, frames, fdi = np.random.default_rng(3), 40, new_fdi()
    D = np.array([[3.0, 0.4, -0.2], [0.1, 2.0, 0.3], [-0.5, 0.2, 1.0]])
    monitor = new_watch(D=D)
    error = np.vstack([np.zeros(3), rng.normal(size=(frames, 3))])
    bound, eta_bar = np.zeros(3), np.array([0.3, 0.2, 0.1])
    growing = np.abs(D)
    growing[np.diag_indices(3)] = -np.diag(D)
    fdi["bound"]["eta_bar"] = eta_bar
    for k in range(frames):
        fdi["bank"]["output"]["innovation"] = (error[k + 1] - error[k]) / DT + D @ error[k]
        watching.advance_gyro_estimate(
            monitor, fdi["bank"]["output"]["innovation"], fdi["bound"]["eta_bar"], fdi["config"]["dt"]
        )
        bound = bound + DT * (eta_bar + growing @ bound)
    assert monitor["memory"]["w"] == pytest.approx(error[-1])
    assert monitor["memory"]["w_bound"] == pytest.approx(bound)


def test_a_bound_of_that_filter_is_never_below_zero():
    monitor = new_watch(D=np.diag([200.0, 1.0, 1.0]), w_bound=(1.0, 1.0, 1.0))
    watching.advance_gyro_estimate(monitor, np.zeros(3), np.zeros(3), DT)
    assert monitor["memory"]["w_bound"] == pytest.approx([0.0, 1 - DT, 1 - DT])


@pytest.mark.parametrize(("size", "clear"), [(0.999, 0), (1.001, 1)])
def test_what_no_gyro_can_be_is_further_from_w_than_all_bounds(size, clear):
    monitor = new_watch(w=(0.0, -0.5, 0.0), w_bound=(0.1, 0.3, 0.1))
    test = monitor["redundancy"]["test"]
    test["B"][:] = 9.0
    test["B"][TURN_TEST + 1, 0] = 0.02
    limit = 0.02 + H * (0.3 + attitude.DAMPING_TOLERANCE * 0.5)
    test["residual"][TURN_TEST + 1] = size * limit + H * 0.5
    watching.exclude_gyros(monitor)
    assert monitor["memory"]["gyros_excluded"] == clear
    assert monitor["memory"]["gap"][1] == pytest.approx([size * limit] * 3)
    watching.exclude_gyros(monitor)
    kept = 1.0 + np.array([0.0, 0.9, 0.99])
    assert monitor["memory"]["gap"][1] == pytest.approx(size * limit * kept)
    assert monitor["memory"]["gap_bound"][1] == pytest.approx(H * 0.4 * (1.0 + np.array([0.0, 0.9, 0.99])))


def test_a_watch_begins_with_its_first_look():
    monitor = new_watch(substep=3)
    measured = np.zeros(1, [("signal", "f8", (N_SENSORS,)), ("force", "f8", (3,))]).view(np.recarray)[0]
    measured["signal"][AIRSPEED], measured["signal"][QDYN], measured["force"] = 45.0, 1000.0, (1.0, 2.0, -9.0)
    (
        monitor["redundancy"]["config"]["g"],
        monitor["redundancy"]["config"]["e_zero"][ALTITUDE],
    ) = 9.8, 0.7
    (
        monitor["redundancy"]["config"]["drift"],
        monitor["redundancy"]["config"]["max_airspeed_mps"],
    ) = 2e-3, 80.0
    watching.begin_monitor(monitor, measured, 5.0)
    relations = monitor["redundancy"]
    assert (monitor["memory"]["stage"], monitor["memory"]["substep"]) == (1, 0)
    assert relations["memory"]["e_past"][[PHI, ALTITUDE]] == pytest.approx(
        [0.01, 0.7]
    )  # drifted since the flight began
    assert (relations["memory"]["e_older"] == relations["memory"]["e_past"]).all()
    assert relations["memory"]["y_past"][AIRSPEED] == 45.0
    assert relations["memory"]["a_past"] == pytest.approx([1.0, 2.0, 0.8])
    assert relations["test"]["past_bound"][CLIMB_TEST] == pytest.approx(0.7)
    assert relations["test"]["B_n"][CLIMB_TEST] == pytest.approx([0.7] * 3)
    assert relations["test"]["past_bound"].shape == (N_TESTS,)


def stood_in(i, signal=(), **fields):
    monitor = new_watch(**fields)
    prediction = np.zeros(1, prediction_dtype(4)).view(np.recarray)[0]
    relations = monitor["redundancy"]
    relations["memory"]["predicted_reading"], relations["memory"]["engine_commands"] = (
        np.arange(N_SENSORS) / 10.0,
        (1800.0, 20.0),
    )
    relations["memory"]["y_past"][[QDYN, AIRSPEED]] = 1000.0, 40.0
    relations["memory"]["y_past"][:3], monitor["config"]["y_trim"] = (0.1, 0.2, 0.3), 7.0
    values = np.zeros(N_SENSORS)
    for sensor, value in dict(signal).items():
        values[sensor] = value
    prediction["f"], prediction["G"], prediction["u"], prediction["u_old"] = (
        (1, 2, 3),
        0.5,
        (0.1, 0.2, 0, 0),
        (0.7, 0, 0, 0),
    )
    relations["test"]["residual"][:3], relations["test"]["r"][:3, 1] = (
        (0.01, 0.02, 0.03),
        (0.4, 0.5, 0.6),
    )
    return float(watching.estimate_reading(monitor, prediction, values, i)), monitor


def test_vanes_are_predicted_and_drift_back_to_trim():
    for vane in (ALPHA, BETA):
        predicted = vane / 10.0
        assert stood_in(vane)[0] == pytest.approx(predicted + H / 20.0 * (7.0 - predicted))


def test_airspeed_and_pressure_stand_in_for_each_other_by_the_density_before():
    assert stood_in(AIRSPEED, {QDYN: 1100.0})[0] == pytest.approx(40.0 * np.sqrt(1.1))
    assert stood_in(QDYN, {AIRSPEED: 44.0})[0] == pytest.approx(1000.0 * 1.21)
    assert stood_in(AIRSPEED, {QDYN: -5.0})[0] == 1.0


def test_attitude_and_altitude_are_predicted_and_the_engine_is_as_commanded():
    assert [stood_in(i)[0] for i in (PHI, PSI, ALTITUDE)] == pytest.approx(
        [PHI / 10, PSI / 10, ALTITUDE / 10]
    )
    assert [stood_in(i)[0] for i in (ENGINE_SPEED, MANIFOLD)] == [1800.0, 20.0]


@pytest.mark.parametrize("gyro", GYROS)
@pytest.mark.parametrize("substep", [0, 1])
def test_a_rate_is_what_the_attitude_shows_and_the_models_change_since(gyro, substep):
    value, monitor = stood_in(gyro, substep=substep)
    u_sum = 0.7 if substep == 0 else 0.3
    acceleration = (1, 2, 3)[gyro] + 0.5 * u_sum
    assert value == pytest.approx((0.1, 0.2, 0.3)[gyro] + (0.01, 0.02, 0.03)[gyro] / H + H * acceleration)
    assert monitor["memory"]["replaced"][gyro]


def test_where_the_attitude_is_noisy_a_rate_follows_it_slowly_after_one_step():
    value, _ = stood_in(1, rate_gain=0.1)
    assert value == pytest.approx(0.2 + 10.0 * 0.5 + H * 2.35)
    value, _ = stood_in(1, rate_gain=0.1, replaced=(0, 1, 0))
    assert value == pytest.approx(0.2 + 0.1 * 0.02 / H + H * 2.35)


def looked(monitor, fdi, **signal):
    """A look at instruments in level flight, with some readings moved."""
    measured = np.zeros(1, MEASURED).view(np.recarray)[0]
    measured["signal"][AIRSPEED], measured["signal"][QDYN] = 45.0, 1000.0
    for name, value in signal.items():
        measured["signal"][{"phi": PHI, "theta": THETA, "altitude": ALTITUDE, "p": 0}[name]] += value
    prediction = np.zeros(1, prediction_dtype(4)).view(np.recarray)[0]
    on(watching.check_sensors, fdi, monitor, prediction, measured, 3.0)
    return measured


def test_looks_of_a_frame_follow_one_another():
    monitor, fdi = new_watch(substep=3), new_fdi()
    fdi["bank"]["output"]["threshold"], fdi["bound"]["nu_max"] = 1.0, 1.0
    monitor["redundancy"]["config"]["g"] = monitor["redundancy"]["config"]["e_zero"] = 0.0
    monitor["redundancy"]["config"]["e_zero"][:] = 1.0
    fdi["bank"]["output"]["innovation"] = 0.5, 0.0, 0.0
    looked(monitor, fdi)
    assert (monitor["memory"]["stage"], monitor["memory"]["substep"]) == (1, 0)
    for k in range(4):
        looked(monitor, fdi, phi=1e-3 * (k % 2))
        assert monitor["memory"]["substep"] == (k + 1) % 4
    assert monitor["memory"]["w"][0] == pytest.approx(0.5 * DT)  # once a frame
    # the gyro's error as the frame began, and the largest inside it: the attitude moved, the rates did not
    assert monitor["memory"]["w_att"] == pytest.approx(np.zeros(3), abs=1e-12)
    assert monitor["memory"]["peak"][0] == pytest.approx(1e-3 / H, rel=1e-3)
    assert monitor["memory"]["floor"][0] == pytest.approx(1e-3 / H, rel=1e-3)
    before = monitor["memory"]["peak"].copy()
    looked(monitor, fdi, phi=2e-3)
    assert monitor["memory"]["w_att"][0] == pytest.approx(-1e-3 / H, rel=1e-2)
    assert monitor["memory"]["peak_past"] == pytest.approx(before)
    assert not monitor["memory"]["peak"].any()
    assert not monitor["memory"]["floor"].any()
    assert monitor["memory"]["floor_past"][0] == pytest.approx(1e-3 / H, rel=1e-3)
    assert monitor["memory"]["w_att_past"] == pytest.approx(np.zeros(3), abs=1e-12)
    assert monitor["memory"]["w"][0] == pytest.approx(2 * 0.5 * DT)


def test_a_broken_altimeter_is_named_and_replaced_from_then_on():
    monitor, fdi = new_watch(), new_fdi()
    fdi["bound"]["nu_max"], fdi["bank"]["output"]["threshold"] = 1.0, 1.0
    looked(monitor, fdi)
    looked(monitor, fdi)
    assert not monitor["output"]["alarmed"]
    measured = looked(monitor, fdi, altitude=50.0)
    assert monitor["output"]["isolated_sensor"] == ALTITUDE
    assert abs(measured["signal"][ALTITUDE]) < 0.1
    assert abs(measured["altitude"]) < 0.1


@pytest.mark.parametrize(("substep", "asked"), [(0, True), (1, False)])
def test_the_rates_are_asked_once_a_frame(substep, asked):
    monitor, fdi = (
        with_shares(
            {TURN_TEST: 2.0, ANGLE_TEST: 1.5},
            substep=substep,
            w_att=(0, 0.3, 0),
            stage=watching.FULL_STAGE,
        ),
        new_fdi(),
    )
    fdi["bank"]["output"]["threshold"], fdi["bound"]["nu_max"] = 1.0, 1.0
    on(watching.isolate_sensor, fdi, monitor, seen(), 5.0)
    assert (monitor["memory"]["gyro_verdict"][1] == GYRO_REFUTED) == asked


@pytest.mark.parametrize(
    ("broken", "engine", "shared", "slipstream"),
    [
        ((), 1, False, False), ((1,), 1, True, False), ((ALPHA,), 1, True, False), ((PHI,), 1, True, False),
        ((AIRSPEED,), 1, True, True), ((QDYN,), 1, True, True), ((ENGINE_SPEED,), 1, True, True),
        ((MANIFOLD,), 1, True, True), ((AIRSPEED, PHI), 1, True, True), ((AIRSPEED,), 0, True, False),
        ((ALTITUDE,), 1, True, False),
    ],
)  # fmt: skip
@pytest.mark.parametrize("missing", [False, True])
def test_what_is_replaced_is_shared_out_and_the_slipstream_is_that_of_what_it_is_made_of(
    broken, engine, shared, slipstream, missing
):
    monitor, measured = new_watch(has_engine=engine), np.zeros(1, MEASURED).view(np.recarray)[0]
    prediction = np.zeros(1, prediction_dtype(4)).view(np.recarray)[0]
    (
        monitor["redundancy"]["memory"]["predicted_reading"],
        monitor["redundancy"]["memory"]["engine_commands"],
    ) = 0.1, (1800.0, 20.0)
    monitor["redundancy"]["memory"]["y_past"][[QDYN, AIRSPEED]] = 1000.0, 44.0
    measured["signal"], measured["y"], measured["attitude"] = 0.3, 9.0, 9.0
    measured["signal"][[AIRSPEED, QDYN, ENGINE_SPEED, MANIFOLD]] = 45.0, 1036.0, 1900.0, 21.0
    for i in broken:
        if missing:
            measured["missing"][i] = 1
        else:
            monitor["output"]["is_reading_unused"][i] = 1
    before = measured["signal"].copy()
    watching.replace_readings(monitor, prediction, measured)
    assert np.flatnonzero(monitor["output"]["is_reading_unused"]).tolist() == sorted(broken)
    assert set(np.flatnonzero(measured["signal"] != before)) == set(broken)
    assert (measured["attitude"][1] != 9.0) == shared
    assert (measured["y"][DPT] != 9.0) == slipstream
    if slipstream:
        engine_and_air = measured["signal"][[ENGINE_SPEED, MANIFOLD, AIRSPEED, QDYN]]
        assert measured["y"][DPT] == pytest.approx(measured_slipstream(*engine_and_air))


def test_at_its_bound_a_test_is_within_it():
    """Shares of exactly one, and residuals of exactly the share that neighbours explain, are no suspicion."""
    at_first = {ALPHA, BETA, AIRSPEED, PHI, THETA}  # nothing is beyond what a first error may have done
    assert suspects({TURN_TEST: 1.0, TURN_TEST + 1: 1.0}, lead=TURN_TEST) == {0, 1, 2, PSI} | at_first
    assert suspects({ANGLE_TEST: 2.0, ANGLE_TEST + 1: 1.0}) == {0, 1, 2, PHI}
    assert suspects({TURN_TEST: 100.0, TURN_TEST + 1: 100.0 * watching.COUPLING_SHARE}) == {0}
    assert suspects({SPEED_TEST: 1.0, DENSITY_TEST: 1.0}, lead=DENSITY_TEST) == {QDYN} | at_first


def latched(monitor, j):
    monitor["memory"]["exceeded"] = 0
    watching.latch_exceeded(monitor)
    return bool(monitor["memory"]["exceeded"][j])


def test_of_a_kind_the_first_filter_says_how_large_it_is():
    """The others have less of it, or more of what was before."""
    monitor = with_shares({TURN_TEST: 0.5, TURN_TEST + 1: 2.0}, alarm_test=TURN_TEST + 1)
    monitor["redundancy"]["test"]["r"][TURN_TEST : TURN_TEST + 3, 1:] = 1e3
    monitor["redundancy"]["test"]["r"][TURN_TEST, 0] = 50.0
    assert latched(monitor, TURN_TEST + 1)
    monitor["redundancy"]["test"]["r"][TURN_TEST, 0] = 70.0
    assert not latched(monitor, TURN_TEST + 1)
    (
        monitor["redundancy"]["test"]["r"][TURN_TEST, 0],
        monitor["redundancy"]["test"]["r"][TURN_TEST + 2, 0],
    ) = (
        0.0,
        -70.0,
    )
    assert not latched(monitor, TURN_TEST + 1)
    for c in (TURN_TEST, ANGLE_TEST):
        small = new_watch()
        (
            small["redundancy"]["test"]["ratio"][c],
            small["redundancy"]["test"]["r"][c, 0],
        ) = 2.0, 1e-6
        assert latched(small, c), "of small residuals the largest is involved"


@pytest.mark.parametrize(
    ("excess", "thrust", "levers", "engines", "failed"),
    [
        (0.0129, 0.4, (0, 0, 9.0), 2, 0), (0.0131, 0.4, (0, 0, 9.0), 2, 1), (-0.0131, 0.4, (0, 0, 0), 2, 1),
        (0.0129, -0.4, (0, 0, 0), 2, 0), (0.0131, -0.4, (0, 0, 0), 2, 1), (0.0131, 0.4, (0, 0.1, 0), 2, 0),
        (0.0131, 0.4, (-0.1, 0, 0), 2, 0), (0.0131, 0.4, (0, 0, 0), 0, 0),
    ],
)  # fmt: skip
def test_engines_under_one_lever_that_yaw_beyond_the_bound_have_failed_and_stay_so(
    excess, thrust, levers, engines, failed
):
    """|Cn + 0.1 CT| > 0.005 + 0.02 |CT|, which is 0.013 here."""
    monitor = fill(
        np.zeros(1, ENGINE_MONITOR_RECORD).view(np.recarray)[0],
        n_engines=engines, i_T=3, i_n=1,
        yaw_per_thrust=-0.1, slack=0.02,
    )  # fmt: skip
    disable_if_apart(monitor, np.array(levers))
    y = np.array([7.0, -0.1 * thrust + excess, 7.0, thrust])
    assert detect_engine_failure(monitor, 0.005, y) == failed
    assert detect_engine_failure(monitor, 0.005, 0.0 * y) == failed
    fdi = new_fdi()
    fdi["engine_monitor"], fdi["bound"]["error_map"]["yaw_now"] = monitor, 0.005
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    axis = adaptive_estimators.find_alarm_axis(fdi, y, 7.5)
    verdict = fdi["verdict"]["isolated_estimator"], fdi["verdict"]["isolated_at_s"]
    assert (axis, *verdict) == ((YAW, UNANTICIPATED, 7.5) if failed else (-1, NOT_ISOLATED, 0.0))
    fdi["verdict"]["detected"], fdi["verdict"]["isolated_estimator"] = 1, NOT_ISOLATED
    assert adaptive_estimators.find_alarm_axis(fdi, y, 7.5) == -1


@pytest.fixture
def duplicates(monkeypatch):
    """Two instruments that should equal another, in the places of the engine's: a heading, an altitude."""
    places = {
        "DUPLICATE": np.array([ENGINE_SPEED, MANIFOLD]),
        "COUNTERPART": np.array([PSI, ALTITUDE]),
        "COUNTERPART_TEST": np.array([TURN_TEST, CLIMB_TEST]),
        "DUPLICATE_TOLERANCE": np.array([0.01, 2.0]), "N_EQUATIONS": RPM_TEST,
        "N_IN_EQUATIONS": ENGINE_SPEED,
    }  # fmt: skip
    for module, name in product((relations, watching), places):
        monkeypatch.setattr(module, name, places[name], raising=False)
    monitor = new_watch()
    monitor["redundancy"]["memory"]["reading_bound"] = np.arange(N_SENSORS) / 1000.0
    readings = np.zeros(N_SENSORS)
    readings[[ENGINE_SPEED, PSI, MANIFOLD, ALTITUDE]] = 3.1, -3.1, 905.0, 900.0
    return monitor, readings


def as_python(compiled):
    """A kernel whose globals are looked up as it runs."""
    return getattr(compiled, "py_func", compiled)


def test_what_should_equal_another_reading_differs_by_the_errors_of_both_and_the_tolerance(duplicates):
    """The heading by 6.2 rad, a turn less 0.083; the altitude by 5 m; neither where it is not fresh."""
    monitor, readings = duplicates
    compare = as_python(relations.compare_duplicates)
    tests = monitor["redundancy"]["test"][RPM_TEST:][:2]
    compare(monitor["redundancy"], readings, np.array([1, 1]))
    bounds = 1e-6 + np.array([0.01 + (ENGINE_SPEED + PSI) / 1e3, 2.0 + (MANIFOLD + ALTITUDE) / 1e3])
    assert tests["residual"] == pytest.approx([6.2 - 2.0 * np.pi, 5.0])
    assert tests["B"][:, 0] == pytest.approx(bounds)
    assert tests["ratio"] == pytest.approx(np.abs(tests["residual"]) / bounds)
    watch = as_python(watching.latch_agreed)
    tests["ratio"] = 1.0, 1.1
    watch(monitor, np.array([0, 1]))
    assert not monitor["memory"]["agreed"].any()
    monitor["output"]["alarmed"] = 1
    watch(monitor, np.array([1, 1]))
    assert not monitor["memory"]["agreed"].any()
    monitor["output"]["alarmed"] = 0
    watch(monitor, np.array([1, 0]))
    assert monitor["memory"]["agreed"][0] == 1
    compare(monitor["redundancy"], readings + 1.0, np.array([1, 0]))
    assert tests["ratio"][1] == 0.0
    assert tests["residual"][1] == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("own_test", "residual", "bound", "frozen", "agreed", "suspected"),
    [
        (0, 5.0, 1.4, 0, 1, {"duplicate"}), (1, 5.0, 1.4, 0, 1, {"reading"}),
        (0, -5.0, 1.6, 0, 1, {"duplicate", "reading"}), (0, 5.0, 1.5, 0, 1, {"duplicate", "reading"}),
        (0, 5.0, 1.4, 3, 1, {"duplicate", "reading"}), (0, 5.0, 1.4, 2, 1, {"duplicate"}),
        (0, 5.0, 1.4, 0, 0, {"duplicate", "reading"}), (0, -5.0, 1.4, 0, 1, {"duplicate"}),
    ],
)  # fmt: skip
def test_of_two_that_differ_the_reading_is_suspected_unless_its_own_test_would_show_it(
    duplicates, own_test, residual, bound, frozen, agreed, suspected
):
    """An error of 5 less 2 beyond the bound of both: hidden up to twice that of the reading's own test."""
    monitor, _ = duplicates
    test = monitor["redundancy"]["test"]
    test["residual"][RPM_TEST], test["B"][RPM_TEST, 0] = residual, 2.0
    test["B"][TURN_TEST, 0] = bound
    monitor["memory"]["exceeded"][TURN_TEST] = own_test
    monitor["memory"]["n_same"][PSI] = frozen
    monitor["memory"]["agreed"][0] = agreed
    as_python(watching.suspect_duplicate)(monitor, 0)
    places = {"duplicate": ENGINE_SPEED, "reading": PSI}
    expected = sorted(places[name] for name in suspected)
    assert np.flatnonzero(monitor["output"]["suspect"]).tolist() == expected


def test_angles_are_held_against_angles_and_rates_against_rates():
    assert suspects({TURN_TEST + 2: 100.0, ANGLE_TEST: 2.0}) == {2, PHI}
    assert suspects({ANGLE_TEST: 100.0, TURN_TEST + 2: 2.0}, lead=TURN_TEST + 2) == {2, PHI}


def test_suspicions_of_the_frame_before_are_gone():
    monitor = with_shares({CLIMB_TEST: 2.0}, alarm_test=CLIMB_TEST)
    monitor["output"]["suspect"] = 1
    watching.latch_exceeded(monitor)
    watching.find_suspects(monitor)
    assert np.flatnonzero(monitor["output"]["suspect"]).tolist() == [ALTITUDE]


def test_an_alarm_on_roll_counts_as_one():
    """The first axis of the bank has number 0, and no axis is -1."""
    monitor, fdi = (
        new_watch(w_att=(0.0, 0.3, 0.0), w_bound=(9.0, 9.0, 9.0)),
        new_fdi(),
    )
    (
        fdi["bound"]["nu_max"],
        fdi["bank"]["output"]["threshold"][:3],
        monitor["memory"]["w_att_past"],
    ) = (
        1.0,
        1.0,
        (0.0, 0.3, 0.0),
    )
    fdi["bank"]["output"]["residual"][0, 0] = 2.0
    on(watching.judge_gyros, fdi, monitor)
    assert monitor["memory"]["gyro_verdict"].tolist() == [GYRO_CONFIRMED] * 3


def test_what_is_named_is_replaced_and_flags_are_one():
    monitor = new_watch()
    watching.mark_isolated(monitor, CLIMB_TEST, 3.0)
    assert monitor["output"]["is_reading_unused"][CLIMB_TEST] == 1
    monitor = new_watch()
    on(watching.raise_alarm, detected_fdi(9.4, 1), monitor, 10.0)
    assert (monitor["output"]["keeps_surface"], monitor["output"]["alarmed"]) == (1, 1)


def test_where_the_attitude_is_blurred_a_look_asks_whether_any_gyro_can_be_it():
    for noisy in (0, 1):
        monitor, fdi = new_watch(noisy=noisy, stage=1, substep=1), new_fdi()
        monitor["memory"]["w"], fdi["bank"]["output"]["threshold"] = (0.5, 0.0, 0.0), 1.0
        monitor["redundancy"]["config"]["e_zero"][:] = 1.0
        looked(monitor, fdi)
        assert bool(monitor["memory"]["gap"].any()) == bool(noisy)


def test_a_pitch_too_steep_for_the_attitude_neither_clears_nor_excludes_a_gyro():
    """A gyro's apparent error is gone only because its test restarts: it counts two whole frames later."""
    shown = {"w_att": (0.0, 0.3, 0.0), "w": (0.0, 0.3, 0.0)}
    monitor, fdi = new_watch(noisy=1, stage=3, gyros_excluded=0, **shown), new_fdi()
    monitor["output"]["alarmed"], monitor["memory"]["gap"] = 1, 0.2
    monitor["memory"]["w_bound"] = 0.1
    fdi["bank"]["output"]["threshold"], fdi["bound"]["nu_max"] = 1.0, 1.0
    memory = monitor["memory"]
    for _ in range(5):
        looked(monitor, fdi, theta=1.4)
        assert (memory["stage"], memory["gyros_excluded"]) == (1, 0)
        assert memory["gyro_verdict"].tolist() == [GYRO_OPEN] * 3
        assert not memory["gap"].any()
    stages = []
    for _ in range(8):
        looked(monitor, fdi, theta=1.2)
        stages.append(int(memory["stage"]))
    assert stages == [1, 1, 1, 2, 2, 2, 2, 3]
    assert memory["gap"][1].all()
