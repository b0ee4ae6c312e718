"""What is read from the truth, and what is written to the log, each frame: names, units, order."""

from collections.abc import Iterable

from beaver_ftc.design.coefficients import SURFACES

AXES = ("p", "q", "r")

FT = 0.3048  # m, exact
PSF = 47.88025898033584  # Pa per lbf/ft2

# Log column, JSBSim property, factor to SI. The first eight are what sensors measure.
TRUTH = (
    ("p_rad_s", "velocities/p-rad_sec", 1.0),
    ("q_rad_s", "velocities/q-rad_sec", 1.0),
    ("r_rad_s", "velocities/r-rad_sec", 1.0),
    ("alpha_rad", "aero/alpha-rad", 1.0),
    ("beta_rad", "aero/beta-rad", 1.0),
    ("airspeed_mps", "velocities/vt-fps", FT),
    ("qdyn_pa", "aero/qbar-psf", PSF),
    ("dpt", "aero/dpt", 1.0),
    ("phi_rad", "attitude/phi-rad", 1.0),
    ("theta_rad", "attitude/theta-rad", 1.0),
    ("psi_rad", "attitude/psi-rad", 1.0),
    ("latitude_rad", "position/lat-gc-rad", 1.0),
    ("longitude_rad", "position/long-gc-rad", 1.0),
    ("altitude_m", "position/h-sl-ft", FT),
    ("pdot_rad_s2", "accelerations/pdot-rad_sec2", 1.0),
    ("qdot_rad_s2", "accelerations/qdot-rad_sec2", 1.0),
    ("rdot_rad_s2", "accelerations/rdot-rad_sec2", 1.0),
    ("envelope_valid", "aero/envelope-valid", 1.0),
    *((f"{s}_pos_rad", f"fcs/{s}-pos-rad", 1.0) for s in SURFACES),
    *((f"{s}_effective_rad", f"fcs/{s}-effective-rad", 1.0) for s in SURFACES),
    *((f"{s}_effectiveness", f"failures/{s}/effectiveness", 1.0) for s in SURFACES),
)
N_TRUTH = len(TRUTH)
_INDEX = {name: index for index, (name, _, _) in enumerate(TRUTH)}

COMMANDS = tuple(f"fcs/{s}-cmd-rad" for s in SURFACES)
MANIFOLD_PRESSURE = "engine/manifold-pressure-inhg"

# Indices compiled code uses.
AIRSPEED, ALPHA, BETA, QDYN, DPT = (
    _INDEX[n] for n in ("airspeed_mps", "alpha_rad", "beta_rad", "qdyn_pa", "dpt")
)
PHI, LATITUDE, LONGITUDE, ALTITUDE = (
    _INDEX[n] for n in ("phi_rad", "latitude_rad", "longitude_rad", "altitude_m")
)
PDOT, ENVELOPE = _INDEX["pdot_rad_s2"], _INDEX["envelope_valid"]
POS, EFFECTIVE = _INDEX["aileron_pos_rad"], _INDEX["aileron_effective_rad"]
TRUE_EFFECTIVENESS = _INDEX["aileron_effectiveness"]

_STATES = (
    "airspeed_mps", "alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s",
    "phi_rad", "theta_rad", "psi_rad", "north_m", "east_m", "altitude_m",
)  # fmt: skip
_TRUTH_EXTRAS = ("pdot_rad_s2", "qdot_rad_s2", "rdot_rad_s2", "qdyn_pa", "dpt", "envelope_valid")


LIKELIHOODS = (
    *(f"{s}_loss_likelihood_share" for s in SURFACES[:3]),
    *(f"{axis}_step_likelihood_share" for axis in AXES),
)


def _per_axis(pattern: str) -> list[str]:
    return [pattern.format(axis) for axis in AXES]


def _estimator_columns(name: str) -> list[str]:
    limits = [f"fie_{name}_{axis}_{what}_rad_s" for axis in AXES for what in ("residual", "lower", "upper")]
    return [*limits, f"fie_{name}_excluded"]


def log_columns(estimators: Iterable[str], power: bool = False, statistical: bool = False) -> tuple[str, ...]:
    """The log's columns in order, for the isolation estimators of these names; power: the law may use the
    engine; statistical: there is a statistical detector, whose tests are logged as shares of its level."""
    return (
        "t_s", *_STATES, *_TRUTH_EXTRAS,
        *_per_axis("{}_measured_rad_s"), *_per_axis("{}_reference_rad_s"), *_per_axis("{}_model_rad_s"),
        *(f"{s}_{what}_rad" for s in SURFACES for what in ("cmd", "pos", "effective")),
        *(f"{s}_saturated" for s in SURFACES),
        *_per_axis("{}_residual_rad_s"), *_per_axis("{}_threshold_rad_s"),
        *_per_axis("{}_eta_bar_rad_s2"), *_per_axis("{}_network_rad_s2"),
        *_per_axis("{}_design_rad_s2"),
        *(column for name in estimators for column in _estimator_columns(name)),
        *(f"{s}_effectiveness_estimate" for s in SURFACES),
        "mode", "detected",
        *(("manifold_pressure_inhg",) if power else ()),
        *(LIKELIHOODS if statistical else ()),
    )  # fmt: skip
