"""Whether power is there: an engine that fails changes trim and motion, and looks like a surface that fails.

The energy height altitude + V^2 / 2g falls as fast as drag takes it where no engine works against it; lift,
whatever the surfaces do to it, takes none. Where it has fallen, since the evidence for an alarm began, as
fast as in the lowest part of healthy flight, with the engine idling, no surface is named: `unknown`, and
`engine` where it goes on.
"""

import numpy as np

from beaver_ftc.aircraft import GRAVITY_MPS2
from beaver_ftc_logs.recording import Floats

ENGINE, UNKNOWN = "engine", "unknown"
LOWEST = 0.15
"""Share of healthy flight in which energy falls as fast as without power."""
_WINDOW_S, _GOES_ON_S = 5.0, 3.0


def climb_of(t_s: Floats, altitude: Floats, airspeed: Floats, run: np.ndarray) -> Floats:
    """Rate of the energy height over the last seconds, m/s, (n,); nan before they have passed."""
    height = altitude + airspeed**2 / (2.0 * GRAVITY_MPS2)
    first = np.searchsorted(t_s, t_s - _WINDOW_S, side="right") - 1
    known = (first >= 0) & (run[np.maximum(first, 0)] == run)
    first = np.maximum(first, 0)
    lasted_s = np.where(known, t_s - t_s[first], 1.0)
    return np.asarray(np.where(known, (height - height[first]) / lasted_s, np.nan))


def renamed(
    t_s: Floats, faulty: np.ndarray, named: np.ndarray, climb: Floats, lowest: float, since_s: Floats
) -> np.ndarray:
    """The names of rows (n,), without a surface where an engine may have failed. since_s (n,): since when the
    evidence for the alarm of each row has gathered.

    That is so while the window of the energy height reaches back to before then, and from where energy falls
    as without power until it rises, which it does by power alone. A row uses nothing later than its time.
    """
    found = named.copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], faulty, [0]])))
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        first = int(np.searchsorted(t_s, since_s[begin]))
        falls, rises = climb[first:end] <= lowest, climb[first:end] > 0.0
        order = np.arange(end - first)
        last_fall, last_rise = (np.maximum.accumulate(np.where(one, order, -1)) for one in (falls, rises))
        doubted = (last_fall > last_rise)[begin - first :]
        share = np.cumsum(falls[begin - first :]) / np.arange(1, end - begin + 1)
        goes_on = doubted & (share > 0.5) & (t_s[begin:end] - t_s[begin] >= _GOES_ON_S)
        says = np.where(np.logical_or.accumulate(goes_on) & doubted, ENGINE, UNKNOWN)
        early = t_s[begin:end] - t_s[first] < _WINDOW_S
        found[begin:end] = np.where(doubted | early, says, named[begin:end])
    return found
