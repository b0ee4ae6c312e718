"""Tables of docs/explanation/theory.md."""

import numpy as np

from beaver_ftc.aircraft import units
from beaver_ftc.diagnosis.bounds import admitted, worst_case
from beaver_ftc.diagnosis.detection import likelihood, noise_model, statistical, tones
from beaver_ftc.diagnosis.monitors import redundancy, sensor_records
from beaver_ftc.plant import instruments
from beaver_ftc.scenario.diagnosis import Bounds, FdiConfig, Statistical
from beaver_ftc.studies.present.tables import markdown_table

CONSTANTS = (  # (section, symbol on the page, module, name there, unit)
    (2, r"$\omega_E$", units, "EARTH_RATE_RAD_S", "rad/s"),
    (2, r"$\rho$", worst_case, "ROUNDING_RAD_S2", "rad/s2"),
    (2, r"$\kappa$", instruments, "NOISE_LIMIT_SIGMA", ""),
    (2, r"$\gamma$", admitted, "GUST_LIMIT_SIGMA", ""),
    (2, "where nobody has measured", worst_case, "UNKNOWN_RAD_S2", "rad/s2"),
    (3, r"$\tau$", admitted, "DELAYS_S", "s"),
    (7, "", likelihood, "N_SLOTS", ""),
    (7, "", likelihood, "RINGING", ""),
    (7, "", noise_model, "CHANCE", ""),
    (7, "", noise_model, "GROWTH_PER_S", "1/s"),
    (7, "", statistical, "MIN_CONSTANT_SHARE", ""),
    (7, "", tones, "N_TONES", ""),
    (7, r"$\omega$", tones, "FREQUENCIES_RAD_S", "rad/s"),
    (7, r"$\tau$", tones, "MEMORY_S", "s"),
    (9, "", sensor_records, "POLES_PER_S", "1/s"),
    (9, "", redundancy, "TURNING_RAD_S", "rad/s"),
    (9, "", redundancy, "FALLING_M_S2", "m/s2"),
    (9, "", redundancy, "DENSITY_HEIGHT_M", "m"),
    (9, "", redundancy, "STEEPEST_RAD", "rad"),
)
SETTINGS = (  # (section, symbol, key of a scenario, of which section of it, unit)
    (3, r"$\lambda$", "detection_pole_per_s", FdiConfig(), "1/s"),
    (3, r"$\lambda$", "pole_bank_per_s", FdiConfig(), "1/s"),
    (4, r"$\lambda$", "isolation_pole_per_s", FdiConfig(), "1/s"),
    (4, "", "forgetting_time_s", FdiConfig(), "s"),
    (7, "", "false_alarms_per_h", Statistical(), "1/h"),
    (7, "", "misnaming", Statistical(), ""),
    (7, r"$\omega$", "uncertainty_rad_s", Statistical(), "rad/s"),
    (9, "", "vertical_wind_mps", Bounds(), "m/s"),
)


def theory_constants() -> str:
    """The constants of the page, and the defaults of its keys, by section."""
    rows = [(at, symbol, name, getattr(module, name), unit) for at, symbol, module, name, unit in CONSTANTS]
    rows += [(at, symbol, key, getattr(section, key), unit) for at, symbol, key, section, unit in SETTINGS]
    return markdown_table(
        ("section", "symbol", "name", "value"),
        [
            (str(at), symbol, f"`{name}`", f"{_said(value)} {unit}".strip())
            for at, symbol, name, value, unit in sorted(rows, key=lambda row: row[0])
        ],
    )


def _said(value: float | tuple[float, ...] | np.ndarray) -> str:
    if isinstance(value, np.ndarray):
        return f"{value[0]:g} to {value[-1]:g}"
    return ", ".join(f"{one:.5g}" for one in np.atleast_1d(value))
