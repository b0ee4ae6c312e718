"""Distinguish an engine failure from a surface fault: both change trim and motion.

Without power, the energy height, altitude + V^2 / 2g, falls at the rate at which drag takes energy. Lift
takes no energy, whatever the surfaces do. If the energy height has fallen as fast as without power since the
evidence for an alarm began, and has not risen since, no surface is named. The name is then `unknown`, and
`engine` if the fall goes on.
"""

import numpy as np

from beaver_ftc.aircraft import GRAVITY_MPS2
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.runs import last_true_row, true_runs

ENGINE = "engine"
UNKNOWN_SURFACE = "unknown"
# Share of healthy flight in which the energy height falls as fast as without power.
UNPOWERED_SHARE = 0.15
_WINDOW_S = 5.0  # the rate of the energy height is a mean over this time
_NAMING_DELAY_S = 3.0  # an alarm that is younger is not named `engine`


def energy_climb_mps(t: Floats, h: Floats, V: Floats, stretch: np.ndarray) -> Floats:
    """Rate of the energy height E = h + V^2 / 2g, m/s, (n,):

        (E - E[i]) / (t - t[i]),    i: the last row that is at least _WINDOW_S earlier

    NaN if row i is in another gap-free stretch or missing. Time t, s, altitude h, m, airspeed V, m/s, and
    number of the stretch, (n,) each.
    """
    E = h + V**2 / (2.0 * GRAVITY_MPS2)
    i = np.searchsorted(t, t - _WINDOW_S, side="right") - 1
    whole = (i >= 0) & (stretch[i] == stretch)
    dt = np.where(whole, t - t[i], 1.0)
    return np.where(whole, (E - E[i]) / dt, np.nan)


def withdraw_surfaces(
    t: Floats, faulty: np.ndarray, names: np.ndarray, climb: Floats, unpowered: float, start: Floats
) -> np.ndarray:
    """The isolated names (n,), with `unknown` or `engine` in the rows in which an engine may have failed.
    t (n,): time, s. climb (n,): rate of the energy height, m/s; unpowered: that without power. start (n,):
    time at which the evidence for the alarm of each row began to increase, s.

    name        rows of an alarm
    unknown     while the evidence is younger than _WINDOW_S, as the rate is then partly from before it;
                and from a row in which the energy height falls as without power until one in which it rises
    engine      the latter rows, once the alarm has lasted for _NAMING_DELAY_S and the energy height has
                fallen so in more than half of its rows

    A name depends on no later row. falling, rising: from the begin of the evidence on; the others: of the
    alarm.
    """
    named = names.copy()
    for begin, end in true_runs(faulty == 1):
        first = int(np.searchsorted(t, start[begin]))
        falling = climb[first:end] <= unpowered
        rising = climb[first:end] > 0.0
        may_have_failed = (last_true_row(falling) > last_true_row(rising))[begin - first :]
        fallen_share = np.cumsum(falling[begin - first :]) / np.arange(1, end - begin + 1)
        has_lasted = t[begin:end] - t[begin] >= _NAMING_DELAY_S
        has_failed = np.logical_or.accumulate(may_have_failed & (fallen_share > 0.5) & has_lasted)
        is_young = t[begin:end] - t[first] < _WINDOW_S
        of_alarm = named[begin:end]  # a view: it changes `named`
        of_alarm[may_have_failed | is_young] = UNKNOWN_SURFACE
        of_alarm[may_have_failed & has_failed] = ENGINE
    return named
