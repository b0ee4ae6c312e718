"""The layout of the surfaces: the axis that each turns most, its group, its partner, its estimators."""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.aircraft import PITCH, Aircraft, main_surface_index_by_axis
from beaver_ftc.compiled import fill, record, sized
from beaver_ftc.diagnosis.detection.blocks import LOSS

PITCH_GROUP, LATERAL_GROUP = 0, 1  # groups of surfaces


@sized
def layout_dtype(n: int) -> np.dtype:
    """Layout of n surfaces. By surface: its dominant axis; its group (PITCH_GROUP or LATERAL_GROUP); its
    partner, the other surface of a group of two in the aircraft's file, or -1; the numbers of the estimators
    of its loss and of its position, or -1. By axis: the main surface."""
    return record(
        dominant_axis=(int, n), group=(int, n), partner=(int, n), main=(int, 3), loss=(int, n),
        position=(int, n),
    )  # fmt: skip


def configure_layout(layout: np.void, rows: Sequence[tuple[str, int, int]], aircraft: Aircraft) -> None:
    """Fill in axes, groups and estimators of the surfaces; rows: (name, kind of hypothesis, surface) of each
    estimator of isolation.py."""
    index = {name: k for k, name in enumerate(aircraft.surfaces)}
    groups = [PITCH_GROUP if axis == PITCH else LATERAL_GROUP for axis in aircraft.dominant_axis]
    fill(
        layout, main=main_surface_index_by_axis(aircraft), dominant_axis=aircraft.dominant_axis,
        group=groups, partner=-1, loss=-1, position=-1,
    )  # fmt: skip
    for names in aircraft.groups.values():
        if len(names) == 2:
            a, b = (index[name] for name in names)
            layout["partner"][[a, b]] = b, a
    for j, (_, kind, s) in enumerate(rows):
        layout["loss" if kind == LOSS else "position"][s] = j
