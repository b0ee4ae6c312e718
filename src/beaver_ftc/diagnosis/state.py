"""Records that several stages of the diagnosis share, and the numbers that stand for names.

The number of a scheme decides which kernels fly: schemes/__init__.py.
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.aircraft import Aircraft, main_surface_index_by_axis
from beaver_ftc.compiled import fill, record, sized
from beaver_ftc.plugins import DETECTORS, is_compiled
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import FdiConfig

NOT_ISOLATED, UNANTICIPATED = -1, -2  # in place of an estimator: no fault isolated; one outside the class
# Of an estimator's `weak` (isolation.py): 0 not weakly excluded; 1 weakly excluded; this value the same,
# because declared damage may have excluded the other estimators.
DAMAGE_EXCLUDES = 2
INTERVAL_THRESHOLD, PUBLISHED_THRESHOLD, CONSTANT_THRESHOLD = 0, 1, 2  # kinds of threshold: isolation.py
EITHER_DETECTOR, WORST_CASE_DETECTOR, STATISTICAL_DETECTOR = 0, 1, 2  # detectors whose conclusions count
AUTHORITIES = {
    "either": EITHER_DETECTOR,
    "worst-case": WORST_CASE_DETECTOR,
    "statistical": STATISTICAL_DETECTOR,
}
# Schemes: ours; the published one; none; that of a plug-in, whose verdict replaces ours.
ADAPTIVE_SCHEME, PUBLISHED_SCHEME, NO_SCHEME, PLUGIN_SCHEME = range(4)
_SCHEMES = {"adaptive-estimators": ADAPTIVE_SCHEME, "zhang2005": PUBLISHED_SCHEME, "none": NO_SCHEME}
# Kinds of hypothesis (isolation.py): a surface has lost effectiveness; it is anywhere in its travel.
LOSS, POSITION_HYPOTHESIS = 0, 1
PITCH_GROUP, LATERAL_GROUP = 0, 1  # groups of surfaces
ROLL, PITCH, YAW, SIDE_FORCE, NORMAL_FORCE = range(5)  # axes, and components of the force (forces.py)


@sized
def plugin_verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED; axis: on which it has an
    alarm; theta: its estimate of the fault parameter; effectiveness (n,): of each surface, of use only if
    has_effectiveness."""
    return record(detected=int, axis=int, isolated=int, theta=float, has_effectiveness=int, effectiveness=n)


@sized
def layout_dtype(n: int) -> np.dtype:
    """Layout of n surfaces. By surface: its dominant axis; its group (PITCH_GROUP or LATERAL_GROUP); its
    partner, the other surface of a group of two in the aircraft's file, or -1; the numbers of the estimators
    of its loss and of its position, or -1. By axis: the main surface."""
    return record(
        dominant_axis=(int, n), group=(int, n), partner=(int, n), main=(int, 3), loss=(int, n),
        position=(int, n),
    )  # fmt: skip


# Configuration that several stages read. enabled: a compiled scheme diagnoses; scheme_number: of that scheme;
# authority, exclusion_authority: the detector whose alarms, and whose exclusions count, EITHER_DETECTOR,
# WORST_CASE_DETECTOR or STATISTICAL_DETECTOR; diagnoses_all_types: faults of every type;
# abrupt: a fault is declared to stay as it is; n_substeps: JSBSim steps in a frame; dt s.
SHARED_CONFIG_RECORD = record(
    enabled=int, scheme_number=int, exclusion_authority=int, authority=int, diagnoses_all_types=int,
    abrupt=int, n_substeps=int, dt=float,
)  # fmt: skip


def configure_shared(cfg: np.void, declared: Declared) -> None:
    """Fill the shared configuration (SHARED_CONFIG_RECORD)."""
    fdi = declared.fdi
    fill(
        cfg, enabled=fdi.diagnoses, dt=1.0 / declared.rate_hz, scheme_number=scheme_number(fdi.scheme),
        exclusion_authority=whose_exclusions(fdi), authority=AUTHORITIES[fdi.authority],
        diagnoses_all_types=fdi.fault_class == "all", abrupt=fdi.fault_profile == "abrupt",
        n_substeps=declared.substeps,
    )  # fmt: skip


def whose_exclusions(config: FdiConfig) -> int:
    """The detector whose exclusions count: EITHER_DETECTOR, WORST_CASE_DETECTOR or STATISTICAL_DETECTOR."""
    if not config.weighs_chance:
        return WORST_CASE_DETECTOR
    if config.fault_class == "all" and config.authority == "statistical":
        return EITHER_DETECTOR  # the worst case excludes types of fault for any authority
    return AUTHORITIES[config.authority]


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


def scheme_number(name: str) -> int:
    """The number of a scheme by its name in plugins.yaml; of every Python plug-in PLUGIN_SCHEME."""
    return _SCHEMES[name] if is_compiled(DETECTORS, name) else PLUGIN_SCHEME
