"""Each kernel of the instruments' redundancy by itself: rotation matrices, a table of sensitivities, sums."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beaver_ftc.design import Dryden
from beaver_ftc.design.model import design_record, jacobian
from beaver_ftc.diagnosis.monitors import redundancy
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    ALPHA,
    ALPHA_TEST,
    ANGLE_TEST,
    BETA,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    N_FROZEN_NEVER,
    PRESSURE_TEST,
    QDYN,
    REDUNDANCY_RECORD,
    RPM_TEST,
    SENSOR_MONITOR_RECORD,
    SPEED_TEST,
    TEST_RECORD,
    THETA,
    TURN_TEST,
)
from beaver_ftc.plant.instruments import ALTITUDE, AX, ENGINE_SPEED, MANIFOLD, N_SENSORS, PHI, SENSORS
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from telling import not_zero

H, GRAVITY, DRIFT, GUST = 0.02, 9.8, 2e-4, 0.7
FLOWS = (ALPHA_TEST, BETA_TEST)


def as_rotation(angles):
    return Rotation.from_euler("ZYX", angles[::-1])


def reading(
    rates=(0.1, -0.2, 0.05), alpha=0.1, beta=-0.06, V=45.0, attitude=(0.4, 0.25, -1.1), altitude=900.0
):
    signal = np.zeros(N_SENSORS)
    signal[:3], signal[3:6], signal[QDYN] = rates, (alpha, beta, V), 0.5 * 1.1 * V * V
    signal[PHI : PHI + 3], signal[ALTITUDE] = attitude, altitude
    signal[ENGINE_SPEED], signal[MANIFOLD] = 1800.0, 20.0
    return signal


def new_step():
    relations = np.zeros(1, REDUNDANCY_RECORD)[0]
    (
        relations["config"]["sample_time_s"],
        relations["config"]["g"],
        relations["config"]["drift"],
        relations["config"]["gust_max"],
        relations["config"]["max_airspeed_mps"],
    ) = H, GRAVITY, DRIFT, GUST, 80.0
    return relations


def velocity_of(signal):
    """Incidence is atan(w / u), sideslip asin(v / V)."""
    sideways = signal[AIRSPEED] * np.sin(signal[BETA])
    ahead = np.sqrt(signal[AIRSPEED] ** 2 - sideways**2)
    return np.array([ahead * np.cos(signal[ALPHA]), sideways, ahead * np.sin(signal[ALPHA])])


@pytest.mark.parametrize("seed", range(4))
def test_a_look_keeps_readings_and_acceleration(seed):
    rng = np.random.default_rng(seed)
    signal = reading(
        attitude=rng.uniform(-1.2, 1.2, 3), alpha=rng.uniform(-0.3, 0.3), beta=rng.uniform(-0.3, 0.3)
    )
    relations, force = new_step(), rng.normal(size=3)
    relations["memory"]["reading_bound"], relations["memory"]["e_past"] = 0.2, 0.1
    redundancy.store_sample(relations, signal, force)
    rotation = as_rotation(signal[PHI : PHI + 3])
    acceleration = force + rotation.inv().apply([0, 0, GRAVITY])
    assert relations["memory"]["y_past"] == pytest.approx(signal)
    assert relations["memory"]["a"] == pytest.approx(acceleration, rel=1e-12)
    assert (relations["memory"]["e_past"] == 0.2).all()
    assert (relations["memory"]["e_older"] == 0.1).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_prediction_turns_attitude_and_velocity_by_the_rates(seed):
    """Velocity by Adams and Bashforth's second order, then seen from axes that have turned."""
    rng = np.random.default_rng(seed)
    signal = reading(attitude=rng.uniform(-1.0, 1.0, 3), rates=rng.uniform(-0.5, 0.5, 3))
    relations, before = new_step(), rng.normal(size=3)
    redundancy.store_sample(relations, signal, rng.normal(size=3))
    relations["memory"]["a_past"], now = (
        before,
        relations["memory"]["a"].copy(),
    )
    relations["memory"]["a_size"] = 3.0, 2.0, 1.0
    redundancy.predict_readings(relations)
    assert relations["memory"]["a_size"][0] == pytest.approx(np.linalg.norm(1.5 * now - 0.5 * before))
    assert relations["memory"]["a_size"][1:].tolist() == [3.0, 2.0]
    assert relations["memory"]["a_size_past"] == pytest.approx(np.linalg.norm(before))
    size = np.linalg.norm(signal[:3])
    by = Rotation.from_rotvec(signal[:3] / size * 2.0 * np.arctan(0.5 * H * size))
    attitude = (as_rotation(signal[PHI : PHI + 3]) * by).as_euler("ZYX")[::-1]
    v = by.inv().apply(velocity_of(signal) + H * (1.5 * now - 0.5 * before))
    predicted = relations["memory"]["predicted_reading"]
    assert predicted[PHI : PHI + 3] == pytest.approx(attitude, abs=1e-13)
    assert relations["memory"]["a_past"] == pytest.approx(by.inv().apply(now), rel=1e-12)
    assert predicted[AIRSPEED] == pytest.approx(np.linalg.norm(v))
    assert predicted[ALPHA] == pytest.approx(np.arctan(v[2] / v[0]))
    assert predicted[BETA] == pytest.approx(np.arcsin(v[1] / np.linalg.norm(v)))
    sinking = as_rotation(signal[PHI : PHI + 3]).apply(velocity_of(signal))[2]
    assert predicted[ALTITUDE] == pytest.approx(900.0 - H * sinking, rel=1e-12)


@pytest.mark.parametrize("i", range(3))
def test_what_each_angle_turns_the_axes_by(i):
    """By a small step of the angle, as a rotation vector in body axes."""
    readings, angles, small = np.zeros(N_SENSORS), np.array([0.4, -0.3, 2.0]), 1e-6
    readings[PHI : PHI + 3] = angles
    moved = angles + small * (np.arange(3) == i)
    one, other = (Rotation.from_euler("ZYX", of[::-1]) for of in (angles, moved))
    turned = (one.inv() * other).as_rotvec() / small
    assert [redundancy.turn_share(readings, axis, i) for axis in range(3)] == pytest.approx(turned, abs=1e-5)


def compared(now, signal, predicted, then):
    relations = new_step()
    relations["memory"]["predicted_reading"], relations["memory"]["y_past"] = predicted, then
    redundancy.fill_residuals(relations, signal, redundancy.attitude(reading(attitude=now)))
    return relations["test"]["residual"].copy()


def test_residuals_are_readings_less_predictions():
    now, previous_attitude = np.array([0.4, 0.25, -1.1]), Rotation.from_rotvec([1e-4, -2e-4, 3e-4])
    attitude = (as_rotation(now) * previous_attitude).as_euler("ZYX")[::-1]
    signal, predicted, then = reading(attitude=attitude), reading(), reading()
    predicted[[AIRSPEED, ALPHA, BETA, ALTITUDE]] -= 0.3, 0.01, -0.02, 4.0
    predicted[PHI : PHI + 3] = now + 2.0 * np.pi * np.array([0, 0, 1])
    then[[QDYN, AIRSPEED]] = 1000.0, 40.0
    residual = compared(now, signal, predicted, then)
    assert residual[TURN_TEST : TURN_TEST + 3] == pytest.approx([1e-4, -2e-4, 3e-4], rel=1e-6)
    assert residual[ANGLE_TEST : ANGLE_TEST + 3] == pytest.approx(attitude - now, abs=1e-14)
    assert residual[[SPEED_TEST, ALPHA_TEST, BETA_TEST, CLIMB_TEST]] == pytest.approx([0.3, 0.01, -0.02, 4.0])
    denser = (signal[QDYN] / signal[AIRSPEED] ** 2) / (1000.0 / 1600.0)
    assert residual[DENSITY_TEST] == pytest.approx(np.log(denser))


def test_a_pressure_that_is_gone_shows_and_stays_finite():
    signal, then = reading(), reading()
    signal[QDYN] = 0.0
    dense = then[QDYN] / then[AIRSPEED] ** 2
    assert compared((0, 0, 0), signal, reading(), then)[DENSITY_TEST] == pytest.approx(np.log(1e-9 / dense))
    assert compared((0, 0, 0), then, reading(), signal)[DENSITY_TEST] == pytest.approx(np.log(dense / 1e-9))


def three_looks(seed):
    """Readings (3, N_SENSORS) of exact instruments: the attitude turns with the rates, the rest moves on."""
    rng = np.random.default_rng(seed)
    looks, attitude = np.zeros((3, N_SENSORS)), rng.uniform(-0.9, 0.9, 3)
    alpha, beta, V, altitude = (
        rng.uniform(*ends) for ends in ((-0.2, 0.3), (-0.2, 0.2), (30, 60), (500, 3000))
    )
    for k in range(3):
        rates = rng.uniform(-0.8, 0.8, 3)
        looks[k] = reading(rates, alpha, beta, V, attitude, altitude)
        looks[k, AX:] = rng.normal(0.0, 10.0, 3)
        attitude = (as_rotation(attitude) * Rotation.from_rotvec(H * rates)).as_euler("ZYX")[::-1]
        alpha, beta, V = (
            alpha + 0.1 * H * rng.normal(),
            beta + 0.1 * H * rng.normal(),
            V + 5.0 * H * rng.normal(),
        )
        altitude += V * H * rng.normal()
    return looks


def residuals(looks):
    """The record after three looks, and the residuals (RPM,) of the last."""
    relations = new_step()
    relations["config"]["drift"] = relations["config"]["gust_max"] = 0.0
    redundancy.store_sample(relations, looks[0], looks[0, AX:])
    relations["memory"]["a_past"] = relations["memory"]["a"]
    redundancy.predict_readings(relations)
    redundancy.store_sample(relations, looks[1], looks[1, AX:])
    redundancy.fill_residuals(relations, looks[2], redundancy.predict_readings(relations))
    return relations, relations["test"]["residual"][:RPM_TEST].copy()


def allowed(relations, signal, sensor, steady, changing):
    """(rate, noise) (RPM,) where these errors of one sensor are declared."""
    relations["config"]["const"], relations["memory"]["e_new"] = (
        0.0,
        0.0,
    )
    for name in ("reading_bound", "e_past", "e_older"):
        relations["memory"][name] = 0.0
        relations["memory"][name][sensor] = steady + changing
    (
        relations["config"]["const"][sensor],
        relations["memory"]["e_new"][sensor],
    ) = (
        steady,
        changing,
    )
    redundancy.bound_residuals(relations, signal)
    return relations["test"]["bound_per_s"][:RPM_TEST].copy(), relations["test"]["bound_per_sample"][
        :RPM_TEST
    ].copy()


SIDES = ((1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, 1, -1), (1, 1, -1))
SIZES = {AIRSPEED: 2.0, QDYN: 50.0, ALTITUDE: 10.0, **dict.fromkeys(range(AX, N_SENSORS), 1.0)}
# The tests by which an instrument is known: its bounds there are hardly wider than what it can do.
KNOWN_BY = {
    **{gyro: {TURN_TEST + gyro, ANGLE_TEST + gyro} for gyro in range(3)},
    **{PHI + i: {TURN_TEST + i, ANGLE_TEST + i} for i in range(3)},
    ALPHA: {ALPHA_TEST},
    BETA: {BETA_TEST},
    AIRSPEED: {SPEED_TEST, DENSITY_TEST},
    QDYN: {DENSITY_TEST},
    ALTITUDE: {CLIMB_TEST},
    **{AX + i: {(SPEED_TEST, BETA_TEST, ALPHA_TEST)[i]} for i in range(3)},
}


@pytest.mark.parametrize("sensor", KNOWN_BY)
def test_no_error_moves_a_residual_further_than_it_is_allowed_to(sensor):
    """By differences: a reading that is off by a constant and by a changing error, of either sign at each of
    three looks. What that makes of the residuals is within what is allowed, and not far within."""
    nearest = np.zeros(RPM_TEST)
    for seed in range(20):
        steady, changing = np.random.default_rng([seed, sensor]).uniform(0.1, 1.0, 2) * SIZES.get(
            sensor, 0.02
        )
        looks = three_looks(seed)
        relations, exact = residuals(looks)
        free = allowed(relations, looks[2], sensor, 0.0, 0.0)[0]
        for sides in SIDES:
            off = looks.copy()
            off[:, sensor] += steady + changing * np.array(sides)
            relations, moved = residuals(off)
            then = allowed(relations, off[1], sensor, steady, changing)[1]
            rate, noise = allowed(relations, off[2], sensor, steady, changing)
            share = np.abs(moved - exact) / np.maximum(H * (rate - free) + noise + then, 1e-12)
            assert (share <= 1.0 + 1e-9).all(), (seed, sides, share)
            nearest = np.maximum(nearest, share)
    assert (nearest[list(KNOWN_BY[sensor])] > 0.6).all(), nearest


def test_a_declared_error_is_of_the_reading_and_what_is_steady_does_not_change():
    """|reading - truth| <= offset + slope |truth|, and |truth| <= (|reading| + offset) / (1 - slope)."""
    relations, signal = new_step(), np.full(N_SENSORS, -3.0)
    signal[PHI + 2] += 2.0 * np.pi  # a heading is off by its slope of the angle from north
    (
        relations["config"]["e_zero"],
        relations["config"]["e_slope"],
        relations["config"]["const"],
    ) = 0.3, 0.1, 0.25
    redundancy.bound_readings(relations, signal)
    truth = (3.0 + 0.3) / 0.9
    assert relations["memory"]["reading_bound"] == pytest.approx(truth - 3.0)
    assert relations["memory"]["e_new"] == pytest.approx(truth - 3.0 - 0.25 + 3e-10, rel=1e-9)


def test_filters_sum_what_was_with_what_each_pole_keeps():
    rng, frames = np.random.default_rng(2), 30
    test, relations = np.zeros(1, TEST_RECORD)[0], new_step()
    relations["config"]["decay"] = keep = np.array([0.0, 0.8, 0.97])
    relations["config"]["gust_change"], test["gust_gain"] = (
        [0.1, 0.2, 0.3],
        0.5,
    )
    residual, rate, noise = rng.normal(size=frames), rng.uniform(1, 2, frames), rng.uniform(1, 2, frames)
    for k in range(frames):
        test["residual"], test["bound_per_s"], test["bound_per_sample"] = residual[k], rate[k], noise[k]
        redundancy.filter_test(relations, test)
    weight = keep[:, None] ** np.arange(frames)[::-1]
    filtered = weight @ residual
    changes = (1.0 - keep) * (weight[:, 1:] @ noise[:-1]) + noise[-1]
    bound = H * weight @ rate + changes + 0.5 * np.array([0.1, 0.2, 0.3])
    assert test["r"] == pytest.approx(filtered)
    assert test["B"] == pytest.approx(bound)
    assert test["ratio"] == pytest.approx(np.max(np.abs(filtered) / bound))
    assert test["past_bound"] == noise[-1]


@pytest.mark.parametrize("engine", [False, True])
def test_a_whole_look_finds_sound_instruments_sound_and_a_wrong_one_wrong(engine):
    relations, signal = new_step(), reading(rates=np.zeros(3), attitude=(0, 0.1, 0))
    relations["config"]["decay"] = [0.0, 0.8, 0.97]
    (
        relations["memory"]["engine_commands"],
        relations["config"]["e_zero"][ENGINE_SPEED],
        relations["config"]["e_zero"][MANIFOLD],
    ) = (
        (1700.0, 20.5),
        10.0,
        0.25,
    )
    redundancy.store_sample(relations, signal, np.array([GRAVITY * np.sin(0.1), 0.0, -GRAVITY * np.cos(0.1)]))
    relations["test"]["B_n"] = 1e-6
    redundancy.run_tests(relations, signal, engine)
    assert (relations["test"]["ratio"][:CLIMB_TEST] < 1.0).all()
    # 100 rpm too fast where 10 are declared, 0.5 inHg too low where a quarter is
    shares = relations["test"]["ratio"][[RPM_TEST, PRESSURE_TEST]]
    assert shares == pytest.approx([10.0, 2.0] if engine else [0.0, 0.0], rel=1e-5)
    assert relations["test"]["residual"][[RPM_TEST, PRESSURE_TEST]] == pytest.approx(
        [100.0, -0.5] if engine else [0, 0]
    )


def test_a_reading_that_jumps_fails_its_own_test():
    relations, signal = new_step(), reading(rates=np.zeros(3), attitude=(0, 0.1, 0))
    redundancy.store_sample(relations, signal, np.array([GRAVITY * np.sin(0.1), 0.0, -GRAVITY * np.cos(0.1)]))
    signal[ALTITUDE] += 5.0
    redundancy.run_tests(relations, signal, False)
    assert np.flatnonzero(relations["test"]["ratio"] > 1.0).tolist() == [CLIMB_TEST]


def test_no_air_of_the_standard_atmosphere_thins_faster_than_the_bound_has_it():
    """Density (1 - 2.25577e-5 h)^4.2559, its logarithm falling fastest high up; above 11 km of 216.65 K."""
    troposphere = 4.2559 * 2.25577e-5 / (1.0 - 2.25577e-5 * np.arange(0.0, 11_000.0))
    stratosphere = 9.80665 / (287.053 * 216.65)
    assert (
        max(troposphere.max(), stratosphere) < 1.0 / redundancy.DENSITY_SCALE_HEIGHT_M < 1.01 * stratosphere
    )


UNITS = np.array(
    [0.02, 0.02, 0.02, 0.01, 0.01, 1.0, 30.0, 0.01, 0.01, 0.01, 5.0, 10.0, 0.5, 0.5, 0.5, 0.5]
)  # of the errors of each sensor


def true_flight(rng, looks, h):
    """What exact instruments say (looks, N_SENSORS) of a body that is turned and pushed at random, from the
    middle of it on: rates held over a relations, velocity by two steps, place by three, in a steady wind."""
    rotation, wind = as_rotation(rng.uniform(-0.8, 0.8, 3)), np.array([8.0, -5.0, rng.choice([-1.0, 1.0])])
    velocity = rotation.apply([45.0, 2.0, 4.0]) + wind
    altitude, rates, force = 1500.0, np.zeros(3), np.array([0.0, 0.0, -GRAVITY])
    weight = np.array([0.0, 0.0, GRAVITY])
    pushed, moved, signals = [np.zeros(3)] * 2, [velocity] * 3, []
    for _ in range(looks + 3):
        if rng.random() < 0.15:
            rates, force = rng.uniform(-0.6, 0.6, 3), rng.normal(0.0, 2.2, 3) - [0.0, 0.0, GRAVITY]
        u, v, w = rotation.inv().apply(velocity - wind)
        V = np.sqrt(u * u + v * v + w * w)
        density = 1.225 * (1.0 - 2.25577e-5 * altitude) ** 4.2559
        signals.append(
            [*rates, np.arctan2(w, u), np.arcsin(v / V), V, 0.5 * density * V * V,
             *rotation.as_euler("ZYX")[::-1], altitude, 1800.0, 20.0, *force]
        )  # fmt: skip
        pushed = [rotation.apply(force) + weight, pushed[0]]
        velocity = velocity + h * (1.5 * pushed[0] - 0.5 * pushed[1])
        altitude -= h * (23.0 * moved[0] - 16.0 * moved[1] + 5.0 * moved[2])[2] / 12.0
        moved = [velocity, *moved[:2]]
        size = np.linalg.norm(rates)
        rotation = rotation * Rotation.from_rotvec(
            rates * (2.0 * np.arctan(0.5 * h * size) / max(size, 1e-9))
        )
    return np.array(signals[3:])


@pytest.mark.parametrize("h", [0.05, 0.01, 0.002])
@pytest.mark.parametrize("seed", range(4))
def test_sound_instruments_stay_within_every_bound(seed, h):
    """Each error at its extreme: a bias, a slope, a drift, and noise that jumps from side to side."""
    rng, looks = np.random.default_rng([seed, round(1 / h)]), 100
    true, relations = true_flight(rng, looks, h), new_step()
    side = rng.choice([-1.0, 1.0], (3, N_SENSORS)) * (rng.random((3, N_SENSORS)) < 0.7)
    bias, slope, drift = (
        side[0] * UNITS,
        0.03 * side[1],
        3e-3 * side[2] * (np.abs(np.arange(N_SENSORS) - 8) <= 1),
    )
    noise = rng.choice([0.0, 0.2, 1.0], N_SENSORS) * UNITS
    (
        relations["config"]["sample_time_s"],
        relations["config"]["decay"],
        relations["config"]["gust_max"],
    ) = (
        h,
        np.exp(-h * np.array([1e6, 10.0, 1.0])),
        0.0,
    )
    (
        relations["config"]["e_zero"],
        relations["config"]["const"],
        relations["config"]["e_slope"],
    ) = (
        np.abs(bias) + noise,
        np.abs(bias),
        np.abs(slope),
    )
    relations["config"]["drift"], relations["memory"]["engine_commands"] = (
        np.abs(drift).max(),
        (1800.0, 20.0),
    )
    nearest = np.zeros(13)
    for k in range(looks):
        reading = (1.0 + slope) * true[k] + bias + h * k * drift + noise * rng.choice([-1.0, 1.0], N_SENSORS)
        if k == 0:
            redundancy.start_tests(relations, reading, reading[AX:])
        else:
            redundancy.run_tests(relations, reading, True)
            redundancy.store_sample(relations, reading, reading[AX:])
        nearest = np.maximum(nearest, relations["test"]["ratio"])
    assert (nearest <= 1.0).all(), nearest
    assert (nearest > 0.2).sum() >= 4, nearest


def test_near_the_vertical_attitude_is_not_compared_and_its_tests_begin_anew():
    relations, signal = new_step(), reading(rates=np.zeros(3), attitude=(0.1, 1.25, 0.2))
    relations["config"]["decay"] = 0.0, 0.8, 0.97
    redundancy.start_tests(relations, signal, signal[AX:])
    shares = []
    for pitch in (1.28, 1.31, 1.28, 1.25):
        signal[THETA] = pitch
        redundancy.run_tests(relations, signal, False)
        redundancy.store_sample(relations, signal, signal[AX:])
        shares.append(relations["test"]["ratio"][ANGLE_TEST + 1])
    assert shares[0] > 1.0  # 0.03 rad in a look, and no rates
    assert shares[1:3] == [0.0, 0.0]  # that of now, or that of before, is beyond 1.3 rad
    assert relations["test"]["r"][ANGLE_TEST + 1] == pytest.approx([-0.03] * 3)  # nothing of what was before


def test_the_bound_of_a_climb_knows_the_hardest_of_three_pulls_whichever_it_was():
    """Adams and Bashforth's weights of an acceleration over the three latest steps add up to 4/3 at most."""

    def rate(*pulled):
        relations, signal = new_step(), reading()
        redundancy.store_sample(relations, signal, np.array([0.0, 0.0, -GRAVITY]))
        relations["memory"]["a_size"] = 1.0, *pulled
        redundancy.bound_residuals(relations, signal)
        return relations["test"]["bound_per_s"][CLIMB_TEST]

    assert rate(50.0, 20.0) == rate(20.0, 50.0) == rate(50.0, 50.0)
    assert rate(20.0, 80.0) - rate(20.0, 50.0) == pytest.approx(4.0 / 3.0 * H * 30.0)


def test_a_wrong_airspeed_turns_the_flow_at_most_by_what_it_makes_of_the_pull():
    """In level flight a pull turns the path by pull / V: 2 m/s less, by pull (1/(V - 2) - 1/V) more."""
    signal, pull, rates = reading(rates=np.zeros(3), attitude=np.zeros(3), alpha=0.0, beta=0.0), 30.0, []
    for off in (0.0, 2.0):
        relations = new_step()
        redundancy.store_sample(relations, signal, np.array([0.0, 0.0, -GRAVITY]))
        relations["memory"]["a_size"] = pull
        rates.append(allowed(relations, signal, AIRSPEED, off, 0.0)[0][list(FLOWS)])
    V = signal[AIRSPEED]
    turned = pull * (1.0 / (V - 2.0) - 1.0 / V)
    assert (turned < rates[1] - rates[0]).all()
    assert rates[1] - rates[0] == pytest.approx(turned, rel=0.3)


@pytest.mark.parametrize("seed", range(6))
def test_momentary_errors_of_the_attitude_stay_within_bounds_that_remember_long(seed):
    """A heading that leaps back and forth turns each time about the axis that a blurred bank has by then."""
    rng, relations, signal = np.random.default_rng(seed), new_step(), reading(rates=np.zeros(3))
    relations["config"]["decay"], relations["config"]["drift"] = (
        (0.0, 0.99, 0.9999),
        0.0,
    )
    relations["config"]["e_zero"][PHI : PHI + 3] = sizes = np.array([1e-3, 1e-3, 0.06])
    true = signal[PHI : PHI + 3] * (0.0, 1.0, 1.0)
    for k in range(400):
        signal[PHI : PHI + 3] = true + sizes * rng.choice([-1.0, 0.0, 1.0], 3)
        if k == 0:
            redundancy.start_tests(relations, signal, signal[AX:])
        else:
            redundancy.run_tests(relations, signal, False)
            redundancy.store_sample(relations, signal, signal[AX:])
        assert (relations["test"]["ratio"][TURN_TEST : TURN_TEST + 3] <= 1.0).all(), k


ERRORS = {
    "p": {"noise_std_deg_s": 0.05}, "q": {"bias_deg_s": -0.2}, "r": {"quantum_deg_s": 0.01},
    "alpha": {"scale_error": -0.02}, "V": {"noise_std_mps": 0.5, "quantum_mps": 0.1},
    "psi": {"drift_deg_h": 30.0}, "phi": {"drift_deg_h": -36.0}, "engine_rpm": {"bias_rpm": 4.0},
}  # fmt: skip
Y = np.array([0.1, 0.02, 44.0, 1000.0, 0.3, 0.0, 0.0, 0.0])


def at_sensors(**values):
    return [values.get(name, 0.0) for name in SENSORS]


@pytest.mark.parametrize(("noise_deg", "share"), [(0.0, 1.0), (0.1, 3.0 / 60.0)])
def test_all_that_a_monitor_is_set_up_with_and_no_more(noise_deg, share):
    """At 20 Hz of three instants each: numbers from the declaration, the standard and the design model."""
    sensors = ERRORS | {"theta": {"noise_std_deg": noise_deg}}
    bounds = {"sensors": sensors, "turbulence": "moderate", "vertical_wind_mps": 1.5}
    given = {
        "name": "x", "rate_hz": 20, "substeps": 3,
        "fdi": {"statistical": {}, "bounds": bounds, "sensor_monitor": "always"},
        "initial": {"airspeed_mps": 48, "altitude_m": 1000, "engine_rpm": 2000, "manifold_pressure_inhg": 21},
    }  # fmt: skip
    design, monitor = design_record()[0], np.zeros(1, SENSOR_MONITOR_RECORD)[0]
    redundancy.configure_sensor_monitor(monitor, Declared.of(Scenario.model_validate(given)), design, Y)
    deg, h, sigma = np.pi / 180.0, 1.0 / 60.0, 10.6 * 0.3048
    walk = 6.0 * sigma * np.sqrt(3.0 * 1.4 * 48.0 / (1750.0 * 0.3048))
    fading = 1.0 - np.exp(-2.0 * h * np.array([1e6, 10.0, 1.0]))
    damping = -jacobian(design, np.zeros(3), Y, np.zeros(4))[2]
    frozen = at_sensors(r=N_FROZEN_NEVER, V=50) + np.where(at_sensors(r=1, V=1), 0, 3)
    steady = {"q": 0.2 * deg, "engine_rpm": 4.0}
    expected = {
        "config.enabled": 1, "config.substeps": 3, "config.has_engine": 1,
        "config.y_trim": at_sensors(alpha=0.1, beta=0.02, V=44.0, qdyn=1000.0),
        "config.rate_gain": share, "config.n_frozen": frozen,
        "config.D": damping, "memory.substep": 2, "output.alarmed_at_s": -1.0,
        "output.isolated_sensor": -1, "output.isolated_at_s": -1.0, "redundancy.config.sample_time_s": h,
        "redundancy.config.decay": [0.0, np.exp(-10.0 * h), np.exp(-h)],
        "redundancy.config.g": 9.80665 / (1.0 + 1000.0 / 6_371_000.0) ** 2,
        "redundancy.config.gust_max": 6.0 * sigma,
        "redundancy.config.gust_change": walk * np.sqrt(h / fading),
        "redundancy.config.max_airspeed_mps": 1.4 * 48.0,
        "redundancy.config.low_m": Dryden("moderate").low_m,
        "redundancy.config.wind_max": 1.5,
        "redundancy.config.e_zero": at_sensors(
            p=0.2 * deg, r=0.005 * deg, V=2.05, theta=4.0 * noise_deg * deg, **steady
        ),
        "redundancy.config.e_slope": at_sensors(alpha=0.02),
        "redundancy.config.const": at_sensors(**steady),
        "redundancy.config.drift": 36.0 * deg / 3600.0,
        "redundancy.memory.engine_commands": [2000.0, 21.0],
    } | ({"config.noisy": 1} if noise_deg else {})  # fmt: skip
    found = dict(not_zero(monitor))
    assert set(found) == set(expected)
    for path, value in expected.items():
        assert found[path] == pytest.approx(np.array(value), rel=1e-6, abs=1e-9), path


def test_a_monitor_that_is_off_has_found_nothing_and_holds_no_more():
    monitor = np.zeros(1, SENSOR_MONITOR_RECORD)[0]
    redundancy.configure_sensor_monitor(monitor, Declared.of(Scenario(name="x")), None, None)
    assert {path: value.item() for path, value in not_zero(monitor)} == {
        "output.alarmed_at_s": -1.0, "output.isolated_sensor": -1, "output.isolated_at_s": -1.0,
    }  # fmt: skip


def test_an_error_changes_a_logarithm_by_its_share_of_both_readings_of_no_less_than_one():
    step = new_step()
    step["config"]["const"][QDYN] = 0.2
    for now, before, change in (
        (8.0, 5.0, 0.2 * 0.075 / (1 - 0.04)),
        (0.4, 4.0, 0.15 / 0.8),
        (4.0, 0.4, 0.15 / 0.8),
    ):
        step["memory"]["y_past"][QDYN] = before
        readings = np.full(N_SENSORS, now)
        assert redundancy.bound_log(step.view(np.recarray), readings, QDYN) == pytest.approx(change)
