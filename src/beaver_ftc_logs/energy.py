"""Distinguish an engine failure from a surface fault: both change trim and motion.

Without power the energy height altitude + V^2 / 2g falls at the rate at which drag takes energy; lift takes
none, whatever the surfaces do. If the energy height, since the evidence for an alarm began, has fallen as
fast as in the parts of healthy flight with the engine idling, no surface is named. The name is `unknown`, and
`engine` if the fall goes on.
"""

import numpy as np

from beaver_ftc.aircraft import GRAVITY_MPS2
from beaver_ftc_logs.recording import Floats

ENGINE, UNKNOWN_SURFACE = "engine", "unknown"
UNPOWERED_ENERGY_HEIGHT_RATE_QUANTILE = 0.15
"""Share of healthy flight in which the energy height falls as fast as without power."""
_CLIMB_WINDOW_S, _ENGINE_NAMING_DELAY_S = 5.0, 3.0


def energy_height_rate_mps(
    t_s: Floats, altitude_m: Floats, airspeed_mps: Floats, stretch_number: np.ndarray
) -> Floats:
    """Rate of the energy height over the last seconds, m/s, (n,); nan before they have passed."""
    energy_height_m = altitude_m + airspeed_mps**2 / (2.0 * GRAVITY_MPS2)
    window_begin = np.searchsorted(t_s, t_s - _CLIMB_WINDOW_S, side="right") - 1
    is_within_run = (window_begin >= 0) & (stretch_number[np.maximum(window_begin, 0)] == stretch_number)
    window_begin = np.maximum(window_begin, 0)
    window_s = np.where(is_within_run, t_s - t_s[window_begin], 1.0)
    return np.asarray(
        np.where(is_within_run, (energy_height_m - energy_height_m[window_begin]) / window_s, np.nan)
    )


def withdraw_surfaces_after_engine_failure(
    t_s: Floats,
    faulty: np.ndarray,
    isolated_surfaces: np.ndarray,
    energy_height_rate_mps: Floats,
    unpowered_energy_height_rate_mps: float,
    evidence_start_time_s: Floats,
) -> np.ndarray:
    """The isolated names (n,), with `unknown` or `engine` in the rows in which an engine may have failed.
    evidence_start_time_s (n,): time at which the evidence for the alarm of each row began to increase.

    An engine may have failed while the window of the energy height begins before that time, and from the
    row in which the energy height falls as without power until it rises. A row uses nothing later than its
    time.
    """
    kept_names = isolated_surfaces.copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], faulty, [0]])))
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        evidence_begin = int(np.searchsorted(t_s, evidence_start_time_s[begin]))
        is_falling, is_rising = (
            energy_height_rate_mps[evidence_begin:end] <= unpowered_energy_height_rate_mps,
            energy_height_rate_mps[evidence_begin:end] > 0.0,
        )
        row_index = np.arange(end - evidence_begin)
        last_fall, last_rise = (
            np.maximum.accumulate(np.where(one, row_index, -1)) for one in (is_falling, is_rising)
        )
        is_doubted = (last_fall > last_rise)[begin - evidence_begin :]
        falling_share = np.cumsum(is_falling[begin - evidence_begin :]) / np.arange(1, end - begin + 1)
        is_lasting = (
            is_doubted & (falling_share > 0.5) & (t_s[begin:end] - t_s[begin] >= _ENGINE_NAMING_DELAY_S)
        )
        doubted_names = np.where(np.logical_or.accumulate(is_lasting) & is_doubted, ENGINE, UNKNOWN_SURFACE)
        is_early = t_s[begin:end] - t_s[evidence_begin] < _CLIMB_WINDOW_S
        kept_names[begin:end] = np.where(is_doubted | is_early, doubted_names, isolated_surfaces[begin:end])
    return kept_names
