"""Records that several stages of the diagnosis share, and the numbers that stand for names.

The number of a scheme is the place of its kernels in SCHEME_KERNELS, which plugins.yaml lists.
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import record, sized
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plugins import DETECTORS, compiled_rows
from beaver_ftc.scenario.schema import Scenario

NOT_ISOLATED, UNANTICIPATED = -1, -2
DAMAGE_POSSIBLE = 2  # value of `weakly_excluded`: declared damage may have excluded the others
INTERVAL_THRESHOLD, PUBLISHED_THRESHOLD, CONSTANT_THRESHOLD = 0, 1, 2  # thresholds
EITHER_DETECTOR, WORST_CASE_DETECTOR, STATISTICAL_DETECTOR = 0, 1, 2  # whose alarms count
_AUTHORITIES = {
    "either": EITHER_DETECTOR,
    "worst-case": WORST_CASE_DETECTOR,
    "statistical": STATISTICAL_DETECTOR,
}
LOSS, POSITION = 0, 1  # kinds of hypothesis: isolation.py
PITCH_GROUP, LATERAL_GROUP = 0, 1  # groups of surfaces
ROLL, PITCH, YAW, SIDE_FORCE, NORMAL_FORCE = range(5)  # axes, and components of the force: forces.py


@sized
def plugin_verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED."""
    return record(detected=int, axis=int, isolated=int, theta=float, estimates=int, effectiveness=n)


@sized
def layout_dtype(n: int) -> np.dtype:
    """Axis and group of each of n surfaces, the other one of a group of two, or -1; the main surface of each
    axis; the estimators of a surface's loss and position, or -1."""
    return record(
        dominant_axis=(int, n), group=(int, n), partner=(int, n), main=(int, 3), loss_estimator=(int, n),
        position_estimator=(int, n),
    )  # fmt: skip


# Configuration that several stages read. enabled: a compiled scheme diagnoses; scheme: its number;
# fault_class: that of its row (schemes/adaptive_estimators.py); authority: whose alarms count; every_type:
# faults of every type; abrupt: a fault is declared to stay as it is; instants: of JSBSim, in a frame; dt s.
CONFIG = record(
    enabled=int, scheme=int, fault_class=int, authority=int, every_type=int, abrupt=int, instants=int,
    dt=float,
)  # fmt: skip


def configure_shared(shared: np.void, scenario: Scenario) -> None:
    """Fill what several stages go by (dtype CONFIG)."""
    config = scenario.fdi
    shared["enabled"], shared["dt"] = config.diagnoses, 1.0 / scenario.rate_hz
    shared["scheme"] = scheme_number(config.scheme)
    shared["authority"], shared["every_type"] = _AUTHORITIES[config.authority], config.fault_class == "all"
    shared["abrupt"], shared["instants"] = config.fault_profile == "abrupt", scenario.substeps


def configure_layout(layout: np.void, members: Sequence[tuple[str, int, int]], aircraft: Aircraft) -> None:
    """Fill in axes, groups and estimators of the surfaces; members: of the isolation (isolation.py)."""
    index = {name: s for s, name in enumerate(aircraft.surfaces)}
    layout["main"] = leading_surfaces(aircraft)
    layout["dominant_axis"] = aircraft.dominant_axis
    layout["group"] = [PITCH_GROUP if axis == PITCH else LATERAL_GROUP for axis in aircraft.dominant_axis]
    layout["partner"] = layout["loss_estimator"] = layout["position_estimator"] = -1
    for names in aircraft.groups.values():
        if len(names) == 2:
            one, other = (index[name] for name in names)
            layout["partner"][one], layout["partner"][other] = other, one
    for e, (_, kind, surface) in enumerate(members):
        layout["loss_estimator" if kind == LOSS else "position_estimator"][surface] = e


def leading_surfaces(aircraft: Aircraft) -> list[int]:
    """The surface that leads each of roll, pitch and yaw. Raises BadInput where none does."""
    leads = {
        aircraft.dominant_axis[s]: s for s, name in enumerate(aircraft.surfaces) if name in aircraft.primary
    }
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        if axis not in leads:
            raise BadInput(f"{aircraft.name}: no surface turns it most in {name}, allowed: one for each axis")
    return [leads[axis] for axis in range(3)]


_ROWS = compiled_rows(DETECTORS)
_PLUGIN_KERNELS = f"{__package__}.schemes.adaptive_estimators:PLUGGED"  # of every Python plug-in
SCHEME_KERNELS = (*dict.fromkeys(row["kernels"] for row in _ROWS.values()), _PLUGIN_KERNELS)
PLUGIN_SCHEME = SCHEME_KERNELS.index(_PLUGIN_KERNELS)


def scheme_number(name: str) -> int:
    """The place of a scheme's kernels among SCHEME_KERNELS."""
    return SCHEME_KERNELS.index(_ROWS[name]["kernels"]) if name in _ROWS else PLUGIN_SCHEME
