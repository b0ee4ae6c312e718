"""The blocks of the statistical detector as they follow from what a scenario declares: axes and hypotheses.

A block (blocks.py) is one of the rates or that of a parity view (parity_design.py). Both are filled by
`configure_block`.
"""

from collections.abc import Iterator, Sequence
from math import exp
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.aircraft import AXES, PITCH, ROLL, YAW, Aircraft
from beaver_ftc.compiled import fill
from beaver_ftc.diagnosis.detection.blocks import (
    ALPHA_CUBED_MOMENT,
    DRIFT_PRIOR_RAD_S2,
    GROUP_SIZE,
    GROWING_LOSS,
    LOSS,
    LOSS_END,
    N_GROUP_TESTS,
    N_ROWS,
    N_SLOTS,
    SIGN_OF_KIND,
    STEP_FAULT,
)
from beaver_ftc.diagnosis.detection.rows import RATES, set_columns
from beaver_ftc.diagnosis.tolerances import moment_axis
from beaver_ftc.scenario.declared import Declared

ROLL_YAW_PLANE = (ROLL, YAW)
# Rate kappa of the growing-loss hypothesis. It explains a third of a loss that grows ten times slower or
# faster; a constant loss explains the rest.
KAPPA_PER_S = 1.5
# Share of the alarm level reserved for noise in addition to an uncertainty at its bound (statistical.md).
LEVEL_NOISE_SHARE = 0.5


class Entry(NamedTuple):
    """A hypothesis of a block: fields of HYPOTHESIS_RECORD. column counts if it raises alarms."""

    kind: int
    surface: int
    axis: int
    alarms: bool = False
    column: int = 0


def hypotheses_by_block(aircraft: Aircraft) -> Iterator[tuple[tuple[int, ...], list[Entry]]]:
    """Axes and hypotheses of each block of the rates, in their order; roll and yaw come twice
    (statistical.py).

        LOSS                       of each surface of `class_of_losses` whose dominant axis is in the block
        STEP_FAULT                 on each axis of the block
        ALPHA_CUBED_MOMENT         on pitch
        GROWING_LOSS, LOSS_END     of each of these surfaces in turn

    Only LOSS and STEP_FAULT raise alarms. Columns of scores: by loss, then by axis of a step.
    """
    lost = aircraft.class_of_losses
    for axes in ((PITCH,), ROLL_YAW_PLANE, ROLL_YAW_PLANE):
        losses = [
            Entry(LOSS, s, axis, True, lost.index(name))
            for s, (name, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True))
            if name in lost and axis in axes
        ]
        entries = [*losses, *(Entry(STEP_FAULT, -1, axis, True, len(lost) + axis) for axis in axes)]
        entries += [Entry(ALPHA_CUBED_MOMENT, -1, PITCH)] if PITCH in axes else []
        entries += [Entry(kind, e.surface, e.axis) for e in losses for kind in (GROWING_LOSS, LOSS_END)]
        yield axes, entries


def configure_block(
    b: np.void, axes: Sequence[int], m: np.ndarray, R: np.ndarray, entries: Sequence[Entry], **others: Any
) -> None:
    """Fill axes, directions m (axes, N_ROWS), filter and hypotheses of a block, and its other fields.

    R (axes,), (rad/s)2: variance of a reading of the rates, and so of their estimate at the start. a is 1
    until `statistical.fill_drift` fills the decay of the drift. A step acts along the direction of its axis;
    the other signatures follow in flight (`rows.project_rows`).
    """
    n = len(axes)
    fill(b, n=n, a=1.0, Q_scale=1.0, n_h=len(entries), **others)
    b["axes"][:n] = axes
    b["m"][:n] = m
    b["R_y"][:n] = R
    b["P_xx"][:n, :n] = np.diag(R)
    b["P_dd"][:n, :n] = DRIFT_PRIOR_RAD_S2**2 * np.eye(n)
    for h, entry in zip(b["hypothesis"], entries, strict=False):
        fill(h, **entry._asdict())
        h["signature"][:n] = [entry.kind == STEP_FAULT and entry.axis == axis for axis in axes]
    sign = np.zeros(GROUP_SIZE * len(b["tests"]))
    sign[: len(entries)] = [SIGN_OF_KIND[entry.kind] for entry in entries]
    b["tests"]["sign"] = sign.repeat(N_SLOTS).reshape(-1, N_GROUP_TESTS)


def configure_blocks(stat: np.void, declared: Declared, rate: float, dt_s: float) -> None:
    """Fill the blocks of the rates, and how many columns of scores they have.

    rate: largest change of the bounded uncertainty within a frame, over its bound. If a loss is declared
    abrupt, it neither grows nor ends, and the hypotheses of this are left out.
    """
    aircraft = declared.aircraft
    cfg = stat["test"]
    rows = stat["rows"]
    left_out = (GROWING_LOSS, LOSS_END) if declared.fdi.fault_profile == "abrupt" else ()
    share = 0.0 if declared.is_noise_free else LEVEL_NOISE_SHARE
    cfg["n_scores"] = len(aircraft.class_of_losses) + len(AXES)
    for b, (axes, all_entries) in zip(stat["block"], hypotheses_by_block(aircraft), strict=True):
        configure_block(
            b, axes, np.eye(N_ROWS)[list(axes)], rows["R"][list(axes)],
            [entry for entry in all_entries if entry.kind not in left_out],
            source=RATES, eta_rate=rate, alarm_level=cfg["alarm_level"], noise_share=share,
        )  # fmt: skip
        b["hypothesis"]["decay"] = exp(-KAPPA_PER_S * dt_s)
        terms = [k for k, term in enumerate(aircraft.moments) if moment_axis(term) in axes]
        readings = range(len(aircraft.moments), int(rows["n"]))
        set_columns(b, rows, [*terms, *readings] if rows["n"] else [])
