"""Records of the diagnosis, and the numbers that stand for its words."""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import record, sized
from beaver_ftc.diagnosis.schemes.rows import place_of
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import Scenario

NOT_ISOLATED, UNANTICIPATED = -1, -2
BESIDE_DAMAGE = 2  # an estimator doubted for the damage that the aircraft declares
INTERVAL, PUBLISHED, CONSTANT = 0, 1, 2  # thresholds
EITHER, WORST_CASE, STATISTICS = 0, 1, 2  # whose alarms count
_AUTHORITIES = {"either": EITHER, "worst-case": WORST_CASE, "statistical": STATISTICS}
LOSS, POSITION = 0, 1  # kinds of hypothesis: isolation.py
IN_PITCH, IN_ROLL_AND_YAW = 0, 1  # groups of surfaces
ROLL, PITCH, YAW, SIDE, NORMAL = range(5)  # axes, and the accelerometers beside them: forces.py


@sized
def verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED."""
    return record(detected=int, axis=int, isolated=int, theta=float, estimates=int, effectiveness=n)


@sized
def layout_dtype(n: int) -> np.dtype:
    """Axis and group of each of n surfaces, the other one of a group of two, or -1; the main surface of each
    axis; the estimators of a surface's loss and position, or -1."""
    return record(
        dominant_axis=(int, n), group=(int, n), partner=(int, n), main=(int, 3), loss_of=(int, n),
        position_of=(int, n),
    )  # fmt: skip


# What several stages go by. enabled: a compiled scheme diagnoses; scheme: place of its kernels
# (schemes/rows.py); fault_class: place of the class's (schemes/fault_classes.py); authority: whose alarms
# count; every_type: faults of every type; abrupt: a fault is declared to stay as it is; instants: of JSBSim,
# in a frame; dt s.
CONFIG = record(
    enabled=int, scheme=int, fault_class=int, authority=int, every_type=int, abrupt=int, instants=int,
    dt=float,
)  # fmt: skip


def configure(shared: np.void, scenario: Scenario) -> None:
    """Fill what several stages go by (dtype CONFIG)."""
    config = scenario.fdi
    shared["enabled"], shared["dt"] = config.diagnoses, 1.0 / scenario.rate_hz
    shared["scheme"] = place_of(config.scheme)
    shared["authority"], shared["every_type"] = _AUTHORITIES[config.authority], config.fault_class == "all"
    shared["abrupt"], shared["instants"] = config.fault_profile == "abrupt", scenario.substeps


def configure_layout(layout: np.void, members: Sequence[tuple[str, int, int]], aircraft: Aircraft) -> None:
    """Fill in axes, groups and estimators of the surfaces; members: of the isolation (isolation.py)."""
    index = {name: s for s, name in enumerate(aircraft.surfaces)}
    layout["main"] = leaders_of(aircraft)
    layout["dominant_axis"] = aircraft.dominant_axis
    layout["group"] = [IN_PITCH if axis == PITCH else IN_ROLL_AND_YAW for axis in aircraft.dominant_axis]
    layout["partner"] = layout["loss_of"] = layout["position_of"] = -1
    for names in aircraft.groups.values():
        if len(names) == 2:
            one, other = (index[name] for name in names)
            layout["partner"][one], layout["partner"][other] = other, one
    for e, (_, kind, surface) in enumerate(members):
        layout["loss_of" if kind == LOSS else "position_of"][surface] = e


def leaders_of(aircraft: Aircraft) -> list[int]:
    """The surface that leads each of roll, pitch and yaw. Raises BadInput where none does."""
    leads = {
        aircraft.dominant_axis[s]: s for s, name in enumerate(aircraft.surfaces) if name in aircraft.primary
    }
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        if axis not in leads:
            raise BadInput(f"{aircraft.name}: no surface turns it most in {name}, allowed: one for each axis")
    return [leads[axis] for axis in range(3)]
