"""The directions in which the rates are looked at to tell what a surface cannot have done (across.py)."""

from collections.abc import Iterator

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.diagnosis.state import (
    LATERAL,
    LOSS,
    MAX_HYPOTHESES,
    N_SLOTS,
    PITCH,
    PITCH_BLOCK,
    SENSE,
    STEP,
)

PRIOR_DRIFT_RAD_S2 = 1.0  # what a drift may be at the start of a flight: soon forgotten


def views_of(aircraft: Aircraft) -> Iterator[tuple[int, tuple[float, float, float], list[int]]]:
    """Of each view the surface across whose column it is, or -1, its direction, and whose losses it tries.

    The axes for themselves; and in roll and yaw across the column of each surface that leads one of them.
    """
    in_pitch = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield -1, (0.0, 1.0, 0.0), in_pitch
    yield -1, (1.0, 0.0, 0.0), lateral
    yield -1, (0.0, 0.0, 1.0), lateral
    for s in lateral:
        if aircraft.surfaces[s] in aircraft.primary:
            yield s, (1.0, 0.0, 0.0), [other for other in lateral if other != s]


def set_up_views(statistical: np.void, aircraft: Aircraft) -> None:
    """Fill the views of a statistical record whose blocks are set up."""
    views = list(views_of(aircraft))
    statistical["n_views"] = len(views)
    for view, (surface, mix, movers) in zip(statistical["views"], views, strict=False):
        view["surface"], view["mix"], block = surface, mix, view["block"]
        axes = statistical["block"][PITCH_BLOCK if mix[PITCH] else LATERAL]
        tried = movers[: MAX_HYPOTHESES - 1]
        kinds, n = [STEP, *(LOSS for _ in tried)], int(axes["n_regressors"])
        block["n"], block["n_hypotheses"], block["keep"] = 1, len(kinds), 1.0
        block["P_xx"][0, 0], block["P_dd"][0, 0] = axes["noise"].max(), PRIOR_DRIFT_RAD_S2**2
        for name in ("level", "chance", "pace"):
            block[name] = axes[name]
        block["n_regressors"], block["tolerance"][:n] = n + (surface >= 0), axes["tolerance"][:n]
        block["tolerance"][n] = float(surface >= 0)  # of how far errors turn the column, as it is in flight
        hypotheses = block["hypothesis"][: len(kinds)]
        hypotheses["kind"], hypotheses["surface"], hypotheses["alarms"] = kinds, [-1, *tried], 1
        block["lane"]["sense"].reshape(N_SLOTS, -1)[:, : len(kinds)] = [SENSE[kind] for kind in kinds]
