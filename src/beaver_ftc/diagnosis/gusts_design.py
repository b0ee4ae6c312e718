"""The record of the gust estimate, and its noise, as they follow from what a scenario declares.

y, u     readings and deflections in trim
V        airspeed in trim, m/s
sigma    standard deviation of a gust, m/s
v_g      sum of the changes of the gust, m/s (gusts.py)
"""

from math import hypot, pi

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S, FORCES, GRAVITY_MPS2
from beaver_ftc.compiled import fill
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.design.plain_model import jacobian
from beaver_ftc.design.table import AIRSPEED, fill_table
from beaver_ftc.design.turbulence import SCALE_M, rotation_lengths
from beaver_ftc.diagnosis.gusts import MIN_UNMEASURED_SHARES
from beaver_ftc.diagnosis.monitors.residual_bounds import EARTH_M_S2
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors

INTEGRATION_NOISE_GAIN = 1.6  # noise gain of the two-step method: sqrt(1.5^2 + 0.5^2), rounded up
MAX_GUST_STDS = 4.0  # limit of the estimated gust velocity, standard deviations
LARGE_ANGLE_RAD = 0.3  # attitudes and incidences of up to 17 deg
MAX_PATH_SLOPE_RAD = 0.3  # largest slope of the path: this share of an error of gravity acts along the path
MAX_DRAG_OVER_WEIGHT = 0.3  # largest drag over weight: errors of coefficients are a share of the drag


def configure_gust(gust: np.void, declared: Declared) -> None:
    """Fill the record for the declared turbulence. The gust is measured only if the forces are known, by the
    design model or by accelerometers.
    """
    air = declared.air
    aircraft = declared.aircraft
    span = aircraft.geometry.span_m
    output = gust["output"]
    memory = gust["memory"]
    altitude = declared.sensors["altitude"]
    known = bool(aircraft.measurable_forces)
    measured = known or output["uses_accelerometers"]
    fill(output, gusty=air.moves, measured=measured)
    fill_table(memory["table"], aircraft, aircraft.measurable_forces, FORCES, declared.scale)
    aloft = air.rotation_walk(span)
    fill(memory, Q=aloft, share=MIN_UNMEASURED_SHARES if measured else 1.0)
    fill(
        gust["config"], has_forces=known, coarse_only=air.moves and not measured, span=span, Q_aloft=aloft,
        S_m=aircraft.geometry.wing_area_m2 / declared.mass.mass_kg, Q_1m=air.rotation_walk_at_1_m(span),
        gravity=GRAVITY_MPS2,  # standard; `configure_gust_speed` bounds its change with place
        h0=altitude.worst, h1=altitude.slope, L_gust=SCALE_M, L_roll=rotation_lengths(span)[0],
    )  # fmt: skip


def add_gust_noise(
    stat: np.void, errors: SensorErrors, design: np.void, y: np.ndarray, u: np.ndarray, dt: float
) -> None:
    """Add the noise of the gust estimate to the model noise of the detector.

    It is the noise of the flow angles from the vanes, rad, and, if accelerometers predict the velocity,
    theirs, integrated over a frame of dt s; the sum of both, as if they were fully correlated. The estimate
    without vanes, `gust_noise` of the forces, has the noise of the accelerometers over the effect of the flow
    angle. y, u: in trim.
    """
    std = flow_noise(errors, y[AIRSPEED])
    forces = stat["forces"]
    gust = stat["gust"]
    span = float(gust["config"]["span"])
    if forces["in_use"] or gust["output"]["uses_accelerometers"]:
        std += INTEGRATION_NOISE_GAIN * errors.each("random", ("az", "ay")) * dt / y[AIRSPEED]
    if forces["in_use"]:
        components = forces["component"][::-1]  # normal force first: `gust_noise` takes incidence, sideslip
        by_forces = np.sqrt(components["var_acc"]) / np.abs(components["e_vane"])
        forces["gust_noise"] = gust_noise(by_forces, design, y, u, span)
    for name in ("Q0", "Q"):
        stat["noise"][name] += gust_noise(std, design, y, u, span) ** 2


def air_rotation_slopes(model: DesignFunctions, y: np.ndarray) -> np.ndarray:
    """Angular acceleration of an aircraft at rest in air that rotates, (3, 3) 1/s: -df/dx without rates, by
    central differences with steps of 1e-4 rad/s."""
    steps = 1e-4 * np.eye(3)
    return -((model.f(steps, y) - model.f(-steps, y)) / 2e-4).T


def flow_noise(errors: SensorErrors, V: float) -> np.ndarray:
    """Standard deviation (2,) rad of the noise of the flow's angles in level axes, computed from vanes,
    airspeed and attitude:

        hypot(sigma_vane, sigma_attitude) + LARGE_ANGLE_RAD (sigma_V / V + sigma_phi)

    An error of pitch attitude or heading turns the flow as much as an error of a vane. V: airspeed, m/s.
    """
    pairs = (("alpha", "theta"), ("beta", "psi"))
    sigma = [hypot(errors[vane].random, errors[attitude].random) for vane, attitude in pairs]
    return np.array(sigma) + LARGE_ANGLE_RAD * (errors["V"].random / V + errors["phi"].random)


def gust_noise(sigma: np.ndarray, model: np.void, y: np.ndarray, u: np.ndarray, b: float) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of the estimated effect of a gust, by the noise sigma (2,) rad of the
    flow's angles:

        sqrt((F_q s_q)^2 + (F_r s_r)^2)      s_q = pi V sigma_alpha / (4 b)      s_r = pi V sigma_beta / (3 b)

    s: noise of the rotation of the air, rad/s (gusts.py); F (3,) 1/s: d(f + G u) / d rate; b: span, m; V:
    airspeed, m/s.
    """
    s_q, s_r = sigma * pi * y[AIRSPEED] / (np.array([4.0, 3.0]) * b)
    _, F_q, F_r = jacobian(model, np.zeros(3), y, u)[2].T  # without rates all of it is aerodynamic
    return np.sqrt((F_q * s_q) ** 2 + (F_r * s_r) ** 2)


def configure_gust_speed(gust: np.void, declared: Declared, level: float, V: float) -> None:
    """If a gust is measured, fill the decay rate a_v of its velocity, its limit MAX_GUST_STDS sigma, and the
    error variance of the speed:

        a_v^3 = 2 e_a^2 rate / sigma^2
        var_V = sigma^2 a_v / (a_v + rate) + (e_a / a_v)^2 + noise^2 + e_V^2

    noise, e_V m/s: of the airspeed's reading, and its constant error. level: of the alarm, standard
    deviations.

    The sum v_g decays at the rate a_v, 1/s, so an error e_a of the acceleration, m/s2, that predicts the
    velocity gives it an error e_a / a_v. A gust returns to zero at the rate V over its length, so the
    decaying sum misses the variance sigma^2 a_v / (a_v + rate). The total of both is least near this a_v.
    """
    sigma = declared.air.sigma_mps
    errors = declared.sensors
    out = gust["output"]
    if not (out["gusty"] and out["measured"]):
        return
    rate = V / SCALE_M
    airspeed = errors["V"]
    drag = GRAVITY_MPS2 * MAX_DRAG_OVER_WEIGHT
    e_a = (
        2.0 * EARTH_RATE_RAD_S * V + MAX_PATH_SLOPE_RAD * EARTH_M_S2
    )  # Coriolis; change of gravity with place
    e_a += GRAVITY_MPS2 * (errors["phi"].steady + errors["theta"].steady)
    if out["uses_accelerometers"]:
        e_a += errors["ax"].steady + drag * errors["ax"].slope
    else:
        e_a += drag * (declared.coefficients.largest + MASS_TOLERANCE)
    a_v = (2.0 * e_a**2 * rate / sigma**2) ** (1.0 / 3.0)
    e_V = airspeed.steady + airspeed.slope * V
    var_V = sigma**2 * a_v / (a_v + rate) + (e_a / a_v) ** 2 + airspeed.random**2 + e_V**2
    fill(
        gust["config"], var_v=sigma**2, v_max=MAX_GUST_STDS * sigma, a_v=a_v, var_V=var_V,
        speed_error_share=speed_error_share(level),
    )  # fmt: skip


def speed_error_share(level: float) -> float:
    """Share of a gust's intensity that a relative error e of the speed leaves, over the variance of e.

    The error adds (e / tau) q to the gust's equation. At the frequency omega its spectrum is

        e^2 (omega / tau)^2 / (omega^2 + 1 / tau^2)^2  <=  e^2 / 4

    times that of a random walk of the gust's intensity. e is normal and independent of the noise. The product
    of two normal numbers exceeds x deviations with a probability of exp(-x). This equals that of the alarm
    level, exp(-level^2 / 2), if e is taken to be level / 2 deviations.
    """
    return (0.5 * level) ** 2 / 4.0
