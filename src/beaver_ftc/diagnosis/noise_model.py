"""From what a scenario declares to the statistical detector's numbers: levels, noise, tolerances."""

from dataclasses import astuple
from math import exp, hypot, pi, sqrt
from statistics import NormalDist

import numpy as np

from beaver_ftc.design.coefficients import GEOMETRY, MassProperties, coefficient_terms, inertia_coefficients
from beaver_ftc.design.model import AILERON, AIRSPEED, ALPHA, AXES, BETA, DPT, ELEVATOR, QDYN, RUDDER, TERMS
from beaver_ftc.design.variants import jacobian
from beaver_ftc.diagnosis.admitted import GUST_FT_S, SCALE_FT, inertia_slack, tolerances
from beaver_ftc.diagnosis.air import damping
from beaver_ftc.diagnosis.state import ALPHA3, LEAST_UNCERTAINTY_RAD_S2, LOSS, N_SLOTS, STEP
from beaver_ftc.plant.instruments import SIGNALS
from beaver_ftc.scenario.diagnosis import Bounds, FdiConfig, Statistical
from beaver_ftc.scenario.sensors import Sensors

# (kind, surface, axis, raises alarms); of the published class, and what it is held against.
PITCH = ((LOSS, ELEVATOR, 1, 1), (STEP, -1, 1, 1), (ALPHA3, -1, 1, 0))
LATERAL = ((LOSS, AILERON, 0, 1), (LOSS, RUDDER, 2, 1), (STEP, -1, 0, 1), (STEP, -1, 2, 1))
BLOCKS = (((1,), PITCH), ((0, 2), LATERAL), ((0, 2), LATERAL))
SIDES = {LOSS: 1, STEP: 2, ALPHA3: 2}  # a loss has a sign, a step may go either way

# Share of the intensity of the rolling, pitching and yawing gust that the vanes leave; on exact vanes and
# over a filter's memory it is less (`tests/diagnosis/test_air.py`).
UNSEEN = (1.0, 0.003, 0.03)
PRIOR_DRIFT_RAD_S2 = 1.0  # what a drift may be at the start of a flight: soon forgotten
LEAST_NOISE_RAD_S = 1e-9  # of a gyro: exact ones are still doubles, and a variance no difference of zeros
Start = tuple[np.ndarray, np.ndarray, np.ndarray]  # x (3,) rad/s, y (5,) and u (4,) rad in trim
_RATE_TERMS = ("p", "q", "r")
_POWERS = {  # of each signal in a term, what a relative error of it counts
    "p": (("p", 1),), "q": (("q", 1),), "r": (("r", 1),),
    "alpha": (("alpha", 1),), "alpha2": (("alpha", 2),), "a2dpt": (("alpha", 2),), "daa": (("alpha", 1),),
    "beta": (("beta", 1),), "beta2": (("beta", 2),), "beta3": (("beta", 3),),
}  # fmt: skip


def tests_a_frame() -> int:
    """How many one-sided tests the detector makes in a frame."""
    return N_SLOTS * sum(SIDES[kind] for _, members in BLOCKS for kind, _, _, alarms in members if alarms)


def alarm_level(false_alarms_per_h: float, rate_hz: float) -> float:
    """Standard deviations at which all tests of an hour together give so many false alarms at most."""
    return -NormalDist().inv_cdf(false_alarms_per_h / (3600.0 * rate_hz * tests_a_frame()))


def naming_level(misnaming: float, rate_hz: float) -> float:
    """Difference of log likelihoods that chance gives with this probability at most within a second."""
    return 0.5 * NormalDist().inv_cdf(misnaming / (rate_hz * tests_a_frame())) ** 2


def set_up(
    fdi: np.void,
    config: FdiConfig,
    design: np.void,
    mass: MassProperties,
    start: Start,
    rate_hz: float,
) -> None:
    """Fill the statistical part of a diagnosis record; start: x (3,), y (5,) and u (4,) in trim."""
    statistical, given = fdi["statistical"], config.statistical
    statistical["detected_at_s"] = -1.0
    if given is None or not fdi["enabled"]:  # a plug-in, or nobody, diagnoses
        return
    statistical["enabled"] = 1
    _set_up_air(statistical["air"], config.bounds.turbulence, mass)
    statistical["n_blocks"] = len(BLOCKS)
    statistical["alarm_level"] = alarm_level(given.false_alarms_per_h, rate_hz)
    statistical["naming_level"] = naming_level(given.misnaming, rate_hz)
    statistical["keep"] = exp(-1.0 / (rate_hz * config.forgetting_time_s))
    _set_up_blocks(statistical, config.bounds.sensors)
    _set_up_noise(statistical, given, config.bounds, design, start, 1.0 / rate_hz)
    _set_up_tolerances(statistical, config.bounds, design, mass, start)
    block = statistical["block"][-1]
    block["lag"] = returning_length(statistical, float(start[1][AIRSPEED]), rate_hz)
    if statistical["air"]["moving"]:
        block["stronger"] = (statistical["air"]["rolling"] / block["lag"]) ** 2
        statistical["jitter"] += _gust_jitter(config.bounds.sensors, design, start[1]) ** 2


def _random_error(sensors: Sensors, name: str) -> float:
    """Standard deviation of what changes from sample to sample: noise and rounding."""
    noise, _, quantum = getattr(sensors, name).noise_bias_quantum
    return sqrt(noise**2 + quantum**2 / 12.0)


def _set_up_blocks(statistical: np.void, sensors: Sensors) -> None:
    for block, (axes, members) in zip(statistical["block"], BLOCKS, strict=True):
        block["n"], block["n_hypotheses"] = len(axes), len(members)
        block["n_regressors"], block["keep"], block["stronger"] = 9 * len(axes), 1.0, 1.0
        for i, axis in enumerate(axes):
            block["axis"][i] = axis
            variance = max(_random_error(sensors, AXES[axis]), LEAST_NOISE_RAD_S) ** 2
            block["noise"][i] = block["P_xx"][i, i] = variance
            block["P_dd"][i, i] = PRIOR_DRIFT_RAD_S2**2
        for hypothesis, (kind, surface, axis, alarms) in zip(block["hypothesis"], members, strict=False):
            hypothesis["kind"], hypothesis["surface"] = kind, surface
            hypothesis["axis"], hypothesis["alarms"] = axis, alarms


def _set_up_noise(
    statistical: np.void,
    given: Statistical,
    bounds: Bounds,
    design: np.void,
    start: Start,
    dt_s: float,
) -> None:
    """What drifts, and what is white: noise of the measurements that f + G u is made of."""
    noise = max(_random_error(bounds.sensors, axis) for axis in AXES)
    largest = max(bounds.constant_rad_s2.as_tuple())
    level = float(statistical["alarm_level"])
    statistical["rapidity"] = rapidity(largest, given.uncertainty_rad_s, noise, level, dt_s)
    _, G, f_x, f_y = jacobian(design, *start)
    errors = np.array([_random_error(bounds.sensors, name) for name in SIGNALS])
    along = np.column_stack([f_x, f_y[:, [ALPHA, BETA, AIRSPEED, QDYN]]])
    statistical["jitter"] = (along**2) @ errors**2
    statistical["deflection"] = np.abs(G).sum(axis=1) * np.radians(bounds.deflection_deg)


def rapidity(eta_bar: float, omega: float, noise: float, level: float, dt_s: float) -> float:
    """Intensity of the random walk that stands for a bounded uncertainty, over its bound squared, 1/s.

    An uncertainty of eta_bar sin(omega t) moves the test for a step by eta_bar omega sqrt(2 sqrt 2 / i w0),
    w0 = (i / n)^(1/4), for a walk of intensity i and gyro noise of density n = noise^2 dt (docs/theory.md).
    With no noise to speak of w0 is the frame rate. A loss under a moving command grows beside the uncertainty
    for as long as both go the same way: by eta_bar sqrt(omega / i) times 1.204, the largest value of
    sin(z) / sqrt(z / 2), z half of omega t. Half the alarm level is left for it: noise alone then takes up no
    more than the other half. eta_bar rad/s2, omega rad/s, noise rad/s, level in standard deviations.
    """
    eta_bar = max(eta_bar, LEAST_UNCERTAINTY_RAD_S2)
    swing = 8.0 * sqrt(2.0) * (eta_bar * omega / level) ** 2  # of i w0
    ramp = 4.0 * (1.204 * eta_bar / level) ** 2 * omega
    walk = (swing * (noise**2 * dt_s) ** 0.25) ** 0.8
    return max(hypot(walk, ramp), swing * dt_s) / eta_bar**2


def returning_length(statistical: np.void, airspeed_mps: float, rate_hz: float) -> float:
    """Within which distance flown, m, the drift of the second view of roll and yaw returns.

    As soon as a bounded uncertainty allows: over the longest window, T, one that swings along with the fault
    moves a test for a drift of intensity i and lag tau by eta_bar sqrt(T / 2 i) / tau, and half the alarm
    level is left for it; and no later than the rolling gust does. A gust that returns later is taken for a
    stronger one, with the same power where it is slow and more where it is fast.
    """
    rolling = float(statistical["air"]["rolling"]) if statistical["air"]["moving"] else 0.0
    if statistical["rapidity"] == 0.0:
        return rolling  # 0 in still air: nothing is declared that drifts, and the two views are one
    longest_s = 2 ** (N_SLOTS - 1) / rate_hz
    lag_s = sqrt(2.0 * longest_s / statistical["rapidity"]) / float(statistical["alarm_level"])
    return min(airspeed_mps * lag_s, rolling or np.inf)


def _set_up_tolerances(
    statistical: np.void,
    bounds: Bounds,
    design: np.void,
    mass: MassProperties,
    start: Start,
) -> None:
    """What is constant but unknown, as tolerances of coefficients: theirs, inertia, steady sensor errors."""
    tolerance = steady_tolerance(bounds, np.asarray(design["coefficient"]), mass, start[1], start[2])
    statistical["block"][0]["tolerance"][:9] = tolerance[1]
    statistical["block"]["tolerance"][1:] = np.concatenate([tolerance[0], tolerance[2]])
    statistical["tolerated"] = bool(np.any(tolerance))


def steady_tolerance(
    bounds: Bounds, coefficient: np.ndarray, mass: MassProperties, y: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Tolerance (3, 9) of each moment coefficient that covers every declared constant error; y, u in trim."""
    size = np.abs(coefficient)
    share = np.full((3, 9), _inertia_share(bounds.inertia, mass))
    for i, names in enumerate(TERMS):
        share[i] += abs(getattr(bounds.sensors, AXES[i]).scale_error) + _steady_share(bounds, "qdyn", y[QDYN])
        for j, name in enumerate(names):
            if name[3:] in _RATE_TERMS:
                share[i, j] += _steady_share(bounds, "V", y[AIRSPEED])
            for signal, power in _POWERS.get(name[3:], ()):
                if signal != AXES[i]:  # a gyro's slope is counted once for all terms of its own axis
                    share[i, j] += power * abs(getattr(bounds.sensors, signal).scale_error)
    total = tolerances(bounds.coefficients, coefficient) + share * size
    alpha, beta = (getattr(bounds.sensors, name).noise_bias_quantum[1] for name in ("alpha", "beta"))
    total[:, 0] += abs(alpha) * _slope_alpha(coefficient, y, u) + abs(beta) * _slope_beta(coefficient, y)
    return total


def _steady_share(bounds: Bounds, name: str, value: float) -> float:
    sensor = getattr(bounds.sensors, name)
    return abs(sensor.noise_bias_quantum[1]) / value + abs(sensor.scale_error)


def _inertia_share(tolerance: float, mass: MassProperties) -> float:
    """Largest relative error of what multiplies a moment on its own axis."""
    slack, nominal = inertia_slack(tolerance, mass), np.abs(astuple(inertia_coefficients(mass)))
    return float(max(slack[i] / nominal[i] for i in (2, 7, 11)))


def _slope_alpha(k: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """|d(Cl, Cm, Cn) / d alpha|, (3,) 1/rad."""
    Cl = 2 * k[0, 4] * y[ALPHA] * y[DPT] + k[0, 6] * u[AILERON]
    return np.abs([Cl, k[1, 1] + 2 * k[1, 2] * y[ALPHA], 0.0])


def _slope_beta(k: np.ndarray, y: np.ndarray) -> np.ndarray:
    """|d(Cl, Cm, Cn) / d beta|, (3,) 1/rad."""
    return np.abs([k[0, 1], 2 * k[1, 4] * y[BETA], k[2, 1] + 3 * k[2, 5] * y[BETA] ** 2])


def _set_up_air(air: np.void, turbulence: str, mass: MassProperties) -> None:
    air["moving"] = turbulence != "none"
    for name, coefficient in (("longitudinal", "CX"), ("side", "CY"), ("normal", "CZ")):
        terms = [term.value for term in coefficient_terms(coefficient) if term.name != "CY_betadot"]
        air[name] = terms
    air["area_per_mass"] = GEOMETRY.wing_area_m2 / mass.mass_kg
    air["gravity"] = 9.80665  # m/s2, standard; what is constant has no part in a change of the gust
    air["span"], air["chord"] = GEOMETRY.span_m, GEOMETRY.chord_m
    air["per_metre"], air["unseen"] = gust_drift(turbulence), UNSEEN
    air["rolling"] = sqrt(0.3048 * SCALE_FT * GEOMETRY.span_m) / 2.6  # [Yeager1998, eq. 10]


def gust_drift(turbulence: str) -> np.ndarray:
    """Intensity of the random walk that each rotating gust is over times short beside its own, over V.

    (3,) rad2/s3 per m/s, for roll, pitch and yaw. The rolling gust is a first-order process with
    sigma = 1.9 sigma_w / sqrt(L b) and a lag of sqrt(L b) / 2.6 V [Yeager1998, eq. 8]: 2 sigma^2 / lag. The
    others are lagged slopes of a velocity of intensity 3 sigma_w^2 V / L [MIL-F-8785C, 3.7], over (V lag)^2.
    """
    sigma_w, L, b = 0.3048 * GUST_FT_S[turbulence], 0.3048 * SCALE_FT, GEOMETRY.span_m
    rolling = 2.0 * 1.9**2 * 2.6 * sigma_w**2 / (L * b) ** 1.5
    velocity = 3.0 * sigma_w**2 / L
    return np.array([rolling, velocity * (pi / (4 * b)) ** 2, velocity * (pi / (3 * b)) ** 2])


def _gust_jitter(sensors: Sensors, design: np.void, y: np.ndarray) -> np.ndarray:
    """Standard deviation, rad/s2 on each axis, of what the vanes' noise adds to the gust they see."""
    V, b = y[AIRSPEED], GEOMETRY.span_m
    speed = 0.3 * _random_error(sensors, "V") / V  # through attitudes of up to 17 deg
    pitching = (_random_error(sensors, "alpha") + speed) * pi * V / (4 * b)
    yawing = (_random_error(sensors, "beta") + speed) * pi * V / (3 * b)
    A = np.zeros((3, 3))
    damping.py_func(np.asarray(design).view(np.recarray), y, A)
    return np.sqrt((A[:, 1] * pitching) ** 2 + (A[:, 2] * yawing) ** 2)
