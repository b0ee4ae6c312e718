"""Two faults on different surfaces (`fdi.pairs`), at the same time or one after the other.

Elevator and flap move pitch alone, ailerons and rudder roll and yaw alone: each plane has its own verdict
(pair_pitch.py, pair_lateral.py).

    types           record of `fault_types_dtype`
    past            record of `conclusion_dtype`, of the frame before
    bank            detection filters
    est             estimators of the isolation; nu_max: bound on the innovation without a fault, rad/s2
    s, srf, t       surface, and its record (records.py); time, s
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.conclusion import UNANTICIPATED
from beaver_ftc.diagnosis.detection.filters import leaves_bound
from beaver_ftc.diagnosis.isolation import LATERAL_GROUP, PITCH_GROUP
from beaver_ftc.diagnosis.types import examination, verdict
from beaver_ftc.diagnosis.types.pair_lateral import isolate_lateral, locate_lateral
from beaver_ftc.diagnosis.types.pair_pitch import isolate_pitch, observe_pitch
from beaver_ftc.diagnosis.types.verdict import NO_SURFACE


@kernel
def observe_pairs(types, layout, est, bank, nu_max):
    """Latch for each group of surfaces whether a residual of the bank has exceeded its threshold on an axis
    of the group. Observe the elapsed frame and judge the one before. The order matters: `locate_lateral` and
    `observe_pitch` replace what `observe_surfaces` has found as if each surface were alone at fault."""
    nu = bank.output.innovation
    for i in range(3):
        if leaves_bound(bank, i):
            types.pair.group_alarm[PITCH_GROUP if i == PITCH else LATERAL_GROUP] = 1
    examination.observe_surfaces(types, layout, est, nu, nu_max)
    locate_lateral(types, layout, est, nu, nu_max)
    observe_pitch(types, layout, est, nu, nu_max)
    examination.judge_frame(types)


@kernel
def decide_pairs(types, past, layout, t):
    """Isolate surfaces and types plane by plane, at t s. Returns the finding on the surface that was isolated
    first, for `conclusion.record_decision`; if there is none, that of UNANTICIPATED or NOT_ISOLATED."""
    outside = isolate_lateral(types, layout, t)
    isolate_pitch(types, layout, t)
    first = NO_SURFACE
    earliest_s = np.inf
    for s, srf in enumerate(types.surface):
        if srf.status.is_isolated and srf.status.isolated_at_s < earliest_s:
            first = s
            earliest_s = srf.status.isolated_at_s
    if first == NO_SURFACE and outside:
        first = UNANTICIPATED
    return verdict.finding_on_surface(types, past, layout, first, t)
