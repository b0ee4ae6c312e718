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
UNPOWERED_SHARE_OF_HEALTHY_FLIGHT = 0.15
"""Share of healthy flight in which the energy height falls as fast as without power."""
_ENERGY_HEIGHT_WINDOW_S, _ENGINE_NAMING_DELAY_AFTER_ALARM_S = 5.0, 3.0


def compute_energy_height_rate_mps(
    t_s: Floats, altitude_m: Floats, airspeed_mps: Floats, stretch_number: np.ndarray
) -> Floats:
    """Rate of the energy height over the last seconds, m/s, (n,); nan before they have passed."""
    energy_height_m = altitude_m + airspeed_mps**2 / (2.0 * GRAVITY_MPS2)
    window_begin_row = np.searchsorted(t_s, t_s - _ENERGY_HEIGHT_WINDOW_S, side="right") - 1
    is_window_gap_free = (window_begin_row >= 0) & (
        stretch_number[np.maximum(window_begin_row, 0)] == stretch_number
    )
    window_begin_row = np.maximum(window_begin_row, 0)
    window_s = np.where(is_window_gap_free, t_s - t_s[window_begin_row], 1.0)
    return np.asarray(
        np.where(is_window_gap_free, (energy_height_m - energy_height_m[window_begin_row]) / window_s, np.nan)
    )


def withdraw_surfaces_where_engine_may_have_failed(
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
    isolated_names = isolated_surfaces.copy()
    alarm_edges = np.flatnonzero(np.diff(np.concatenate([[0], faulty, [0]])))
    for begin, end in zip(alarm_edges[::2].tolist(), alarm_edges[1::2].tolist(), strict=True):
        evidence_begin_row = int(np.searchsorted(t_s, evidence_start_time_s[begin]))
        falls_as_without_power = (
            energy_height_rate_mps[evidence_begin_row:end] <= unpowered_energy_height_rate_mps
        )
        is_rising = energy_height_rate_mps[evidence_begin_row:end] > 0.0
        index_since_evidence_begin = np.arange(end - evidence_begin_row)
        last_falling_index, last_rising_index = (
            np.maximum.accumulate(np.where(condition, index_since_evidence_begin, -1))
            for condition in (falls_as_without_power, is_rising)
        )
        may_engine_have_failed = (last_falling_index > last_rising_index)[begin - evidence_begin_row :]
        falling_share_since_alarm = np.cumsum(
            falls_as_without_power[begin - evidence_begin_row :]
        ) / np.arange(1, end - begin + 1)
        may_engine_be_named = (
            may_engine_have_failed
            & (falling_share_since_alarm > 0.5)
            & (t_s[begin:end] - t_s[begin] >= _ENGINE_NAMING_DELAY_AFTER_ALARM_S)
        )
        engine_or_unknown_names = np.where(
            np.logical_or.accumulate(may_engine_be_named) & may_engine_have_failed, ENGINE, UNKNOWN_SURFACE
        )
        is_evidence_younger_than_window = t_s[begin:end] - t_s[evidence_begin_row] < _ENERGY_HEIGHT_WINDOW_S
        isolated_names[begin:end] = np.where(
            may_engine_have_failed | is_evidence_younger_than_window,
            engine_or_unknown_names,
            isolated_surfaces[begin:end],
        )
    return isolated_names
