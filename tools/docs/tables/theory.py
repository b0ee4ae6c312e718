"""Table of the constants, in docs/reference/glossary.md."""

import numpy as np

from beaver_ftc.aircraft import aircraft
from beaver_ftc.diagnosis import bounds, bounds_design, error_map
from beaver_ftc.diagnosis.detection import block_design, blocks, filters, likelihood, statistical, tones
from beaver_ftc.diagnosis.monitors import numbering, residual_bounds
from beaver_ftc.plant import instruments
from beaver_ftc.studies.present.tables import markdown_table

DERIVED_IN = {
    2: "explanation/detection.md#the-bound-on-the-model-error",
    3: "explanation/detection.md#a-bank-of-poles",
    7: "explanation/statistical.md",
    9: "explanation/instruments.md",
}  # section of the page: where it is derived
CONSTANTS = (  # (section, meaning, module, name there, unit)
    (2, "rotation rate of the Earth", aircraft, "EARTH_RATE_RAD_S", "rad/s"),
    (2, "allowance for rounding", bounds, "ROUNDING_RAD_S2", "rad/s²"),
    (2, "limit of instrument noise, standard deviations", instruments, "NOISE_LIMIT_SIGMA", ""),
    (2, "limit of gusts, standard deviations", bounds_design, "GUST_LIMIT_SIGMA", ""),
    (
        2,
        "bound outside the boxes of a derived model",
        error_map,
        "UNMAPPED_ERROR_RAD_S2",
        "rad/s²",
    ),
    (3, "design delays of the slower filters", filters, "POLE_DELAYS_S", "s"),
    (7, "number of onsets tested together", blocks, "N_SLOTS", ""),
    (
        7,
        "overshoot of the largest effect of model error",
        likelihood,
        "RINGING_FACTOR",
        "",
    ),
    (
        7,
        "share of the alarm level for noise, with model error",
        block_design,
        "LEVEL_NOISE_SHARE",
        "",
    ),
    (7, "growth rate in the signature of a growing loss", block_design, "KAPPA_PER_S", "1/s"),
    (
        7,
        "log-likelihood ratio of an excluded loss, share of the largest",
        statistical,
        "MIN_LLR_SHARE",
        "",
    ),
    (7, "number of frequencies of the oscillation tests", tones, "N_TONES", ""),
    (7, "range of the frequencies of the oscillation tests", tones, "TONES_RAD_S", "rad/s"),
    (7, "time constant of the oscillation tests", tones, "TONE_MEMORY_S", "s"),
    (9, "poles of the filters of the sensor monitor", numbering, "FILTER_POLES_PER_S", "1/s"),
    (
        9,
        "turn rate of the local horizontal",
        residual_bounds,
        "EARTH_TURN_RAD_S",
        "rad/s",
    ),
    (
        9,
        "bound on Coriolis and centrifugal acceleration and gravity",
        residual_bounds,
        "EARTH_M_S2",
        "m/s²",
    ),
    (
        9,
        "climb with a factor e of air density",
        residual_bounds,
        "DENSITY_SCALE_HEIGHT_M",
        "m",
    ),
    (9, "largest pitch attitude of the attitude tests", residual_bounds, "MAX_PITCH_RAD", "rad"),
)


def theory_constants() -> str:
    """The constants of the page, by the page that derives them."""
    return markdown_table(
        ("constant", "name", "value", "unit", "derived in"),
        [
            (meaning, f"`{name}`", _said(getattr(module, name)), unit, derived_in(at))
            for at, meaning, module, name, unit in sorted(CONSTANTS, key=lambda row: row[0])
        ],
    )


def derived_in(section: int) -> str:
    """The page that derives a constant, as a link."""
    where = DERIVED_IN[section]
    return f"[{where.split('/')[1].split('.')[0]}]({where})"


def _said(value: float | tuple[float, ...] | np.ndarray) -> str:
    if isinstance(value, np.ndarray):
        return f"{value[0]:g} to {value[-1]:g}"
    return ", ".join(f"{one:.5g}" for one in np.atleast_1d(value))
