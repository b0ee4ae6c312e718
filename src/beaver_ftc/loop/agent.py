"""What an agent that learns does in a flight and sees of it: actions in, observations and costs out.

Between both, `stepping.fly_on` flies: a step of an agent is three compiled calls, however many frames it has.
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA
from beaver_ftc.loop.stepping import hold

RATE_RAD_S = 0.1  # one unit of an observed rate; a tracking error that costs one unit of reward a second
AIRSPEED_MPS = 10.0
ANGLE_RAD = 0.1
LARGEST = 100.0  # of an observation: a departure is at 60
BESIDE_SURFACES = 12

# Where a row of the log has the measured p and the reference model's, which q and r follow; first
# readings, in SI.
LOOK = record(measured=int, model=int, alpha=float, beta=float, airspeed=float)


def look_of(columns: Sequence[str]) -> np.ndarray:
    """What an agent of a log with these columns looks at, (1,) of LOOK; still without the first readings."""
    look = np.zeros(1, LOOK)
    look["measured"], look["model"] = (columns.index(f"p_{what}_rad_s") for what in ("measured", "model"))
    return look


def note_first_readings(look: np.ndarray, y: np.ndarray) -> None:
    """Note the first readings, y: alpha rad, beta rad, airspeed m/s."""
    for name, value in zip(("alpha", "beta", "airspeed"), y, strict=False):
        look[name] = value


@kernel
def act(frames, action):
    """Hold each surface between its trim (0) and its lower or upper stop (-1, 1), from now on.

    Returns whether the action (n,) is finite; if not, nothing is commanded.
    """
    frame = frames[0]
    layout = frame.control.layout
    for s in range(action.size):
        if not np.isfinite(action[s]):
            return False
        share = min(max(action[s], -1.0), 1.0)
        trim = layout.trim[s]
        reach = trim - layout.low[s] if share < 0.0 else layout.high[s] - trim
        frame.held_rad[s] = trim + share * reach
    hold(frames)
    return True


@kernel
def cost(frames, rows, look):
    """The squared tracking error in units of RATE_RAD_S, times s; over rows of the log, (frames, columns).

    look: (1,) of dtype LOOK.
    """
    where, total = look[0], 0.0
    for k in range(rows.shape[0]):
        for i in range(3):
            error = (rows[k, where.model + i] - rows[k, where.measured + i]) / RATE_RAD_S
            total += error * error
    return total * frames[0].dt


@kernel
def observe(frames, log, look, seen):
    """Fill seen (12 + n,) with what an agent sees of the frame just flown; look: (1,) of dtype LOOK."""
    where, frame = look[0], frames[0]
    row, y = log[frame.row - 1], frame.measured.y
    for i in range(3):
        rate, wanted = row[where.measured + i], row[where.model + i]
        seen[i] = rate / RATE_RAD_S
        seen[6 + i] = wanted / RATE_RAD_S
        seen[9 + i] = (wanted - rate) / RATE_RAD_S
    seen[3] = (y[ALPHA] - where.alpha) / ANGLE_RAD
    seen[4] = (y[BETA] - where.beta) / ANGLE_RAD
    seen[5] = (y[AIRSPEED] - where.airspeed) / AIRSPEED_MPS
    for s in range(frame.held_rad.size):
        held = frame.held_rad[s] if frame.held else frame.control.layout.trim[s]
        seen[BESIDE_SURFACES + s] = (held - frame.control.layout.trim[s]) / ANGLE_RAD
    for i in range(seen.size):
        seen[i] = min(max(seen[i], -LARGEST), LARGEST)
