"""Tables of docs/explanation/theory.md."""

import numpy as np

from beaver_ftc.aircraft import aircraft
from beaver_ftc.diagnosis import bounds
from beaver_ftc.diagnosis.detection import likelihood, noise_model, parity, statistical
from beaver_ftc.diagnosis.monitors import redundancy
from beaver_ftc.plant import instruments
from beaver_ftc.scenario.diagnosis import Bounds, FdiConfig, Statistical
from beaver_ftc.studies.present.tables import markdown_table

CONSTANTS = (  # (section, meaning, module, name there, unit)
    (2, "rate of the Earth", aircraft, "EARTH_RATE_RAD_S", "rad/s"),
    (2, "allowance for rounding", bounds, "ROUNDING_RAD_S2", "rad/s2"),
    (2, "limit of instrument noise, in standard deviations", instruments, "NOISE_LIMIT_SIGMA", ""),
    (2, "limit of gusts, in standard deviations", bounds, "GUST_LIMIT_SIGMA", ""),
    (2, "bound where the error of a derived model was not measured", bounds, "UNKNOWN_RAD_S2", "rad/s2"),
    (3, "delays for which poles are chosen", bounds, "DESIGN_DELAYS_S", "s"),
    (7, "number of onsets that are tested together", likelihood, "N_SLOTS", ""),
    (7, "sum of the magnitudes of a transient over its sum", likelihood, "RINGING", ""),
    (7, "share of the level reserved for noise", noise_model, "CHANCE", ""),
    (7, "rate of the signature of a growing loss", noise_model, "GROWTH_PER_S", "1/s"),
    (7, "least share of the best ratio that a constant loss explains", statistical, "MIN_CONSTANT_SHARE", ""),
    (7, "number of frequencies of the oscillation tests", parity, "N_TONES", ""),
    (7, "range of these frequencies", parity, "FREQUENCIES_RAD_S", "rad/s"),
    (7, "memory of the oscillation tests", parity, "MEMORY_S", "s"),
    (9, "poles of the filters", redundancy, "POLES_PER_S", "1/s"),
    (9, "rotation and curvature of the Earth", redundancy, "EARTH_TURN_RAD_S", "rad/s"),
    (
        9,
        "Coriolis and centrifugal acceleration, change of gravity",
        redundancy,
        "EARTH_ACCELERATION_M_S2",
        "m/s2",
    ),
    (9, "height in which density falls by a factor e", redundancy, "DENSITY_SCALE_HEIGHT_M", "m"),
    (9, "largest pitch attitude of the attitude tests", redundancy, "STEEPEST_RAD", "rad"),
)
SETTINGS = (  # (section, meaning, key of a scenario, of which section of it, unit)
    (3, "pole of the published filter", "detection_pole_per_s", FdiConfig(), "1/s"),
    (3, "further poles", "pole_bank_per_s", FdiConfig(), "1/s"),
    (4, "pole of the isolation estimators", "isolation_pole_per_s", FdiConfig(), "1/s"),
    (4, "memory of the estimates", "forgetting_time_s", FdiConfig(), "s"),
    (7, "declared rate of false alarms", "false_alarms_per_h", Statistical(), "1/h"),
    (7, "probability of a wrong exclusion in a second", "misnaming", Statistical(), ""),
    (7, "fastest swing of the model error", "uncertainty_rad_s", Statistical(), "rad/s"),
    (9, "strongest vertical wind", "vertical_wind_mps", Bounds(), "m/s"),
)


def theory_constants() -> str:
    """The constants of the page, and the defaults of its keys, by section."""
    rows = [(at, meaning, name, getattr(module, name), unit) for at, meaning, module, name, unit in CONSTANTS]
    rows += [(at, meaning, key, getattr(section, key), unit) for at, meaning, key, section, unit in SETTINGS]
    return markdown_table(
        ("section", "constant", "name", "value", "unit"),
        [
            (str(at), meaning, f"`{name}`", _said(value), unit)
            for at, meaning, name, value, unit in sorted(rows, key=lambda row: row[0])
        ],
    )


def _said(value: float | tuple[float, ...] | np.ndarray) -> str:
    if isinstance(value, np.ndarray):
        return f"{value[0]:g} to {value[-1]:g}"
    return ", ".join(f"{one:.5g}" for one in np.atleast_1d(value))
