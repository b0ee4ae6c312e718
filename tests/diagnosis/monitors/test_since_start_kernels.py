"""Errors that were there from the first look on, in flights by rotation matrices: none is ever ruled out.

The flights move about all axes, fast and slowly, with sideslip and bank; their readings are sound but for
one, which is off from the first look on by a constant, by a scale, or by what swings slowly.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beaver_ftc.diagnosis.monitors import initial_errors, redundancy
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    ALPHA,
    ALPHA_TEST,
    BETA,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    H_AIRSPEED,
    H_ALPHA,
    H_BETA,
    H_PHI,
    H_THETA,
    N_INITIAL,
    N_TESTS,
    QDYN,
    SENSOR_MONITOR_RECORD,
    SPEED_TEST,
    THETA,
    TURN_TEST,
)
from beaver_ftc.plant.instruments import ALTITUDE, AX, N_SENSORS, PHI

GRAVITY, LOOKS = 9.8, 100
READING = {
    H_ALPHA: ALPHA,
    H_BETA: BETA,
    H_AIRSPEED: AIRSPEED,
    H_PHI: PHI,
    H_THETA: THETA,
}
NAMES = {
    H_ALPHA: "alpha",
    H_BETA: "beta",
    H_AIRSPEED: "V",
    H_PHI: "phi",
    H_THETA: "theta",
}
SHOWN = {H_ALPHA: 0.1, H_BETA: 0.12, H_PHI: 0.1, H_THETA: 0.1}


def flight(seed, h, swiftly):
    """Readings (LOOKS, N_SENSORS) of a flight with every motion, and no error."""
    rng = np.random.default_rng(seed)
    t = h * np.arange(LOOKS)
    size, pace = (0.3, 4.0) if swiftly else (0.06, 1.0)
    rates, felt = np.zeros((LOOKS, 3)), np.zeros((LOOKS, 3))
    for i in range(3):
        rates[:, i] = size * np.sin(pace * rng.uniform(0.5, 1.5) * t + rng.uniform(0, 6))
        felt[:, i] = (1.0, 0.6, 1.5)[i] * np.sin(pace * rng.uniform(0.5, 1.5) * t + rng.uniform(0, 6))
    turn = Rotation.from_euler("ZYX", (rng.uniform(-3, 3), rng.uniform(-0.2, 0.3), rng.uniform(-0.5, 0.5)))
    alpha, beta, V, altitude = rng.uniform(0.03, 0.2), rng.uniform(-0.1, 0.1), rng.uniform(35, 55), 900.0
    v = turn.apply(V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]))
    down, before, signal = np.array([0.0, 0.0, GRAVITY]), None, np.zeros((LOOKS, N_SENSORS))
    for k in range(LOOKS):
        force = felt[k] - turn.inv().apply(down)  # so that it does not fall: accelerations are those drawn
        body, angles = turn.inv().apply(v), turn.as_euler("ZYX")[::-1]
        V = np.linalg.norm(v)
        signal[k, :3], signal[k, PHI : PHI + 3], signal[k, AX:] = rates[k], angles, force
        signal[k, [ALPHA, BETA, AIRSPEED]] = np.arctan2(body[2], body[0]), np.arcsin(body[1] / V), V
        air = 1.225 * (1.0 - 2.25577e-5 * altitude) ** 4.2559
        signal[k, QDYN], signal[k, ALTITUDE] = 0.5 * 1.1 * air * V * V, altitude  # on a cold day
        acceleration = turn.apply(felt[k])
        before = acceleration if before is None else before
        altitude -= h * v[2]
        v = v + h * (1.5 * acceleration - 0.5 * before)
        before, turn = acceleration, turn * Rotation.from_rotvec(h * rates[k])
    return signal


def course(kind, size, true, h):
    """An error that is there from the first look on."""
    t = h * np.arange(LOOKS)
    return {
        "constant": np.full(LOOKS, size),
        "scale": 1.6 * size * true,
        "swinging": size * (1.0 + 0.1 * np.sin(0.7 * t)),
    }[kind]


def new_watch(h):
    monitor = np.zeros(1, SENSOR_MONITOR_RECORD).view(np.recarray)[0]
    relations = monitor["redundancy"]
    (
        relations["config"]["sample_time_s"],
        relations["config"]["decay"],
        relations["config"]["g"],
    ) = (
        h,
        np.exp([-1e6 * h, -10.0 * h, -h]),
        GRAVITY,
    )
    relations["config"]["wind_max"], relations["config"]["max_airspeed_mps"] = 1.0, 80.0
    (
        relations["config"]["e_zero"][:3],
        relations["config"]["const"][:3],
    ) = 2e-4, 1e-4
    relations["config"]["e_zero"][[ALPHA, BETA, PHI, THETA]] = 5e-4
    (
        relations["config"]["e_zero"][AIRSPEED],
        relations["config"]["e_zero"][QDYN],
        relations["config"]["e_zero"][ALTITUDE],
    ) = (
        0.05,
        2.0,
        0.5,
    )
    return monitor


def sizes(i, reading, true):
    """The error as since_start counts it."""
    return reading / true - 1.0 if i == H_AIRSPEED else 2.0 * np.sin(0.5 * (reading - true))


def looks(signal, h):
    """Each look's number and the monitor, all that was beyond its bound by then noted as fired."""
    monitor = new_watch(h)
    redundancy.start_tests(monitor["redundancy"], signal[0], signal[0, AX:])
    initial_errors.start_bounds(monitor["initial_errors"], signal[0])
    redundancy.store_sample(monitor["redundancy"], signal[0], signal[0, AX:])
    fired = np.zeros(N_TESTS, int)
    for k in range(1, len(signal)):
        redundancy.run_tests(monitor["redundancy"], signal[k], 0)
        initial_errors.update_bounds(monitor["redundancy"], monitor["initial_errors"], signal[k])
        fired |= monitor["redundancy"]["test"]["ratio"] > 1.0
        initial_errors.latch_refuted(monitor["redundancy"], monitor["initial_errors"], fired)
        yield k, monitor, fired
        redundancy.store_sample(monitor["redundancy"], signal[k], signal[k, AX:])


def test_small_errors_move_each_prediction_by_its_derivative():
    """Of the kinematics, by differences. What is largest is so over all values of the angle itself."""
    h, V, (p, q, r), step = 0.05, 41.0, (0.3, -0.2, 0.5), 1e-5
    at = np.array([0.3, -0.4, 0.6, 0.5])  # alpha, beta, phi, theta
    a = np.array([3.0, 0.0, -7.0])  # in the plane of symmetry, where the angle of attack turns all of it
    monitor = new_watch(h)
    memory, errors = monitor["redundancy"]["memory"], monitor["initial_errors"]
    memory["y_past"][:3], memory["y_past"][AIRSPEED] = (p, q, r), V
    memory["y_past"][[ALPHA, BETA, PHI, THETA]] = at
    memory["y_past"][ALTITUDE], memory["predicted_reading"][ALTITUDE] = 900.0, 898.5
    memory["a"], errors["e"] = a, 1e-8
    readings = memory["y_past"].copy()
    readings[AIRSPEED] = 42.0
    initial_errors.fill_effects(monitor["redundancy"], errors, readings)
    signed = {
        name: errors["C"][getattr(initial_errors, name)] / h
        for name in (
            "PHI_Q", "PHI_R", "THETA_TURN", "PHI_DOWN", "PHI_SIDE", "THETA_G", "ALPHA_CLIMB", "VANE_ROLL",
            "VANE_YAW", "ALPHA_FORCE", "BETA_FORCE", "SPEED_ALPHA", "SPEED_BETA", "SPEED_DENSITY",
        )
    }  # fmt: skip

    def parts(alpha, beta, phi, theta):
        turn, ahead = p * np.cos(alpha) + r * np.sin(alpha), a[0] * np.cos(alpha) + a[2] * np.sin(alpha)
        up, level = np.sin(theta), np.cos(theta)
        tilt = np.sin(beta) * np.sin(phi) + np.sin(alpha) * np.cos(beta) * np.cos(phi)
        return {
            "turn": turn, "rolled": np.tan(beta) * turn, "pushed": -ahead * np.sin(beta) / V,
            "lifted": (a[2] * np.cos(alpha) - a[0] * np.sin(alpha)) / (V * np.cos(beta)),
            "down": GRAVITY * level * np.cos(phi), "side": GRAVITY * level * np.sin(phi),
            "ahead": GRAVITY * up,
            "climb": V * (np.cos(alpha) * np.cos(beta) * up - tilt * level),
        }  # fmt: skip

    def slope(part, i, of=at):
        low, high = np.array(of, float), np.array(of, float)
        low[i], high[i] = low[i] - step, high[i] + step
        return (parts(*high)[part] - parts(*low)[part]) / (2.0 * step)

    def largest(part, i):
        angles = np.linspace(-np.pi, np.pi, 20_001)
        return abs(
            slope(part, i, [angles if i == j else np.full(angles.size, at[j]) for j in range(4)])
        ).max()

    here = parts(*at)
    assert signed == pytest.approx(
        {
            "PHI_Q": q, "PHI_R": r,
            "THETA_TURN": q * np.sin(at[2]) + r * np.cos(at[2]),
            "PHI_DOWN": slope("side", 2),
            "PHI_SIDE": -slope("down", 2),
            "THETA_G": slope("ahead", 3),
            "ALPHA_CLIMB": abs(slope("climb", 0)),
            "VANE_ROLL": here["turn"],
            "VANE_YAW": -slope("turn", 0),
            "ALPHA_FORCE": largest("pushed", 0),
            "BETA_FORCE": abs(slope("lifted", 1)),
            "SPEED_ALPHA": here["lifted"],
            "SPEED_BETA": here["pushed"],
            "SPEED_DENSITY": 2.0 * np.log(42.0 / 41.0) / h,
        }, rel=1e-6,
    )  # fmt: skip
    turned = 1.0 + h * (np.linalg.norm(a) / V + abs(p) + abs(q) + abs(r))
    expected = {
        (H_ALPHA, CLIMB_TEST): largest("climb", 0),
        (H_BETA, CLIMB_TEST): largest("climb", 1),
        (H_PHI, CLIMB_TEST): largest("climb", 2), (H_AIRSPEED, CLIMB_TEST): 1.5 / h,
        (H_ALPHA, ALPHA_TEST): turned * (largest("lifted", 0) + largest("rolled", 0)),
        (H_ALPHA, BETA_TEST): turned * (largest("turn", 0) + largest("pushed", 0)),
        (H_AIRSPEED, DENSITY_TEST): 2.0 * np.log(42.0 / 41.0) / h,
    }  # fmt: skip
    found = {place: errors["H"][place] / h for place in expected}
    assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("i", "test", "by_yaw", "by_force", "force"),
    [
        (H_ALPHA, BETA_TEST, 0.4, 0.2, initial_errors.ALPHA_FORCE),
        (H_BETA, ALPHA_TEST, 0.0, 0.1, initial_errors.BETA_FORCE),
    ],
)
def test_a_vane_is_off_by_no_more_than_its_least_effect_explains(i, test, by_yaw, by_force, force):
    """The least of all errors within the bound, tried one by one, against what the force may take off it."""
    monitor = new_watch(0.01)
    errors, effects = (
        monitor["initial_errors"],
        monitor["initial_errors"]["C_m"],
    )
    errors["e"][i], effects[force] = 0.8, by_force
    effects[initial_errors.VANE_ROLL] = -0.9
    effects[initial_errors.VANE_YAW] = by_yaw
    seen = monitor["redundancy"]["test"]
    seen["r"][test], seen["B"][test] = -0.12, 0.08
    initial_errors.tighten_vanes(monitor["redundancy"], errors, 1)
    half = np.linspace(-np.arcsin(0.4), np.arcsin(0.4), 1001)  # 2 sin(half) is the error
    least = np.min(0.9 * np.cos(half) - by_yaw * np.sin(half)) - by_force
    share_left = 0.8  # of an effect, at least, within a filter's memory
    assert errors["e"][i] == pytest.approx(0.2 / (share_left * least))


@pytest.mark.parametrize("kind", ["constant", "scale", "swinging"])
@pytest.mark.parametrize("i", range(N_INITIAL), ids=NAMES.get)
@pytest.mark.parametrize(("seed", "h", "swiftly"), [(1, 0.01, True), (2, 0.05, False)])
def test_what_is_broken_from_the_start_is_never_refuted(seed, h, swiftly, i, kind):
    rng, true = np.random.default_rng([seed, i]), flight(seed, h, swiftly)
    for size in rng.uniform(0.8, 1.2) * np.array([-0.4, 0.03, 0.5]):
        broken = true.copy()
        factor = true[0, AIRSPEED] if i == H_AIRSPEED else 1.0
        broken[:, READING[i]] += course(
            kind, size * (1.0 if kind == "scale" else factor), true[:, READING[i]], h
        )
        off = abs(sizes(i, broken[:, READING[i]], true[:, READING[i]]))
        moved = set()
        for k, monitor, _ in looks(broken, h):
            initial = monitor["initial_errors"]
            assert off[k] <= (initial["e"][i] + initial["d"][i]) * (1.0 + 1e-9), (
                size,
                k,
            )
            moved |= set(np.flatnonzero(initial["refuted"][i]).tolist())
        assert all(initial_errors.reacts_at_once(i, t) for t in moved), (size, moved)
        assert kind != "constant" or not moved


def test_a_sound_flight_shows_each_reading_to_be_sound():
    """None is beyond its bound, and none can be off by more than a little any more; the airspeed by as little
    as the density of the air says from the first look on."""
    for k, monitor, fired in looks(flight(5, 0.01, True), 0.01):
        assert not fired.any(), k
        initial = monitor["initial_errors"]
    for i, little in SHOWN.items():
        assert initial["e"][i] < little < initial["e_start"][i], NAMES[i]
    assert initial["e"][H_AIRSPEED] < 0.2


def test_in_steady_flight_nothing_shows_the_sideslip_or_the_airspeed():
    """They stay as unknown as at the first look; the attitude is shown by gravity."""
    signal = np.repeat(flight(6, 0.01, False)[:1], LOOKS, axis=0)
    signal[:, :3] = 0.0
    level = Rotation.from_euler("ZYX", signal[0, PHI : PHI + 3][::-1]).inv().apply((0, 0, GRAVITY))
    signal[:, AX:] = -level
    V, alpha, beta = signal[0, [AIRSPEED, ALPHA, BETA]]
    body = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    down = Rotation.from_euler("ZYX", signal[0, PHI : PHI + 3][::-1]).apply(body)[2]
    signal[:, ALTITUDE] -= 0.01 * down * np.arange(LOOKS)
    for _, monitor, fired in looks(signal, 0.01):
        assert not fired.any()
        off, first = (
            monitor["initial_errors"]["e"],
            monitor["initial_errors"]["e_start"],
        )
    assert off[H_BETA] == first[H_BETA]
    assert off[H_AIRSPEED] == first[H_AIRSPEED]
    assert max(off[H_PHI], off[H_THETA]) < 0.06


@pytest.mark.parametrize(
    ("i", "lead", "by", "explained"),
    [
        (H_ALPHA, CLIMB_TEST, (CLIMB_TEST,), False),
        (H_ALPHA, CLIMB_TEST, (7,), True),
        (H_ALPHA, 7, (7,), False),
        (H_AIRSPEED, CLIMB_TEST, (SPEED_TEST, DENSITY_TEST), True),
        (H_AIRSPEED, DENSITY_TEST, (DENSITY_TEST,), False),
        (H_PHI, 8, (TURN_TEST, TURN_TEST + 2, 3), True),
        (H_PHI, 8, (4,), False),
        (H_PHI, TURN_TEST, (TURN_TEST,), False),
        (H_THETA, 8, (TURN_TEST + 1, 4), True),
        (H_THETA, 8, (3,), False),
        (H_BETA, CLIMB_TEST, (12,), False),
        (H_BETA, CLIMB_TEST, (), True),
    ],
)  # fmt: skip
def test_tests_that_show_its_moves_do_not_speak_against_a_first_error(i, lead, by, explained):
    initial = new_watch(0.01)["initial_errors"]
    initial["refuted"][i, list(by)] = 1
    assert initial_errors.explains_exceeded(initial, i, lead) == explained


def test_what_the_airspeed_may_be_off_by_follows_from_the_dynamic_pressure():
    """At 1000 m of the standard the density is 1.1116 kg/m3; a quarter more or less is the weather."""
    for V, true in ((45.0, 45.0), (20.0, 45.0), (90.0, 45.0)):
        signal, initial = np.zeros(N_SENSORS), new_watch(0.01)["initial_errors"]
        signal[[AIRSPEED, ALTITUDE, QDYN, ALPHA]] = V, 1000.0, 0.5 * 1.1116 * true**2, -0.2
        initial_errors.start_bounds(initial, signal)
        ends = V / true * np.sqrt(1.25) - 1.0, 1.0 - V / true * np.sqrt(0.75)
        assert initial["e"][H_AIRSPEED] == pytest.approx(max(ends), rel=1e-3)
        assert initial["e"][H_ALPHA] == pytest.approx(2.0 * np.sin(0.45))
