"""Records that several stages of the diagnosis share, and the numbers that stand for names.

The number of a scheme is the place of its kernels in SCHEME_KERNEL_PATHS, which plugins.yaml lists.
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.aircraft import Aircraft, main_surface_index_by_axis
from beaver_ftc.compiled import record, sized
from beaver_ftc.plugins import DETECTORS, compiled_rows
from beaver_ftc.scenario.declared import Declared

NOT_ISOLATED, UNANTICIPATED = -1, -2
DAMAGE_MAY_HAVE_EXCLUDED_OTHERS = (
    2  # value of `weakly_excluded`: declared damage may have excluded the others
)
INTERVAL_THRESHOLD, PUBLISHED_THRESHOLD, CONSTANT_THRESHOLD = 0, 1, 2  # thresholds
EITHER_DETECTOR, WORST_CASE_DETECTOR, STATISTICAL_DETECTOR = 0, 1, 2  # whose alarms count
_ALARM_AUTHORITY_CODE_OF_NAME = {
    "either": EITHER_DETECTOR,
    "worst-case": WORST_CASE_DETECTOR,
    "statistical": STATISTICAL_DETECTOR,
}
LOSS, POSITION_HYPOTHESIS = 0, 1  # kinds of hypothesis: isolation.py
PITCH_SURFACE_GROUP, LATERAL_SURFACE_GROUP = 0, 1  # groups of surfaces
ROLL, PITCH, YAW, SIDE_FORCE, NORMAL_FORCE = range(5)  # axes, and components of the force: forces.py


@sized
def plugin_verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED."""
    return record(detected=int, axis=int, isolated=int, theta=float, has_effectiveness=int, effectiveness=n)


@sized
def layout_dtype(n: int) -> np.dtype:
    """Axis and group of each of n surfaces, the other one of a group of two, or -1; the main surface of each
    axis; the estimators of a surface's loss and position, or -1."""
    return record(
        dominant_axis=(int, n), group=(int, n), partner=(int, n), main=(int, 3), loss_estimator=(int, n),
        position_estimator=(int, n),
    )  # fmt: skip


# Configuration that several stages read. enabled: a compiled scheme diagnoses; scheme_number: of
# that scheme; isolation_variant: its number (schemes/adaptive_estimators.py); alarm_authority: the detector
# whose alarms count, EITHER_DETECTOR, WORST_CASE_DETECTOR or STATISTICAL_DETECTOR;
# diagnoses_all_types: faults of every type; abrupt: a fault is declared to stay as it is; n_substeps: JSBSim
# frames in a frame; dt s.
SHARED_CONFIG_RECORD = record(
    enabled=int, scheme_number=int, isolation_variant=int, alarm_authority=int, diagnoses_all_types=int,
    abrupt=int, n_substeps=int,
    dt=float,
)  # fmt: skip


def configure_shared_config(shared_config: np.void, declared: Declared) -> None:
    """Fill the shared configuration (SHARED_CONFIG_RECORD)."""
    fdi_config = declared.fdi
    shared_config["enabled"], shared_config["dt"] = fdi_config.diagnoses, 1.0 / declared.rate_hz
    shared_config["scheme_number"] = scheme_number(fdi_config.scheme)
    shared_config["alarm_authority"], shared_config["diagnoses_all_types"] = (
        _ALARM_AUTHORITY_CODE_OF_NAME[fdi_config.authority],
        fdi_config.fault_class == "all",
    )
    shared_config["abrupt"], shared_config["n_substeps"] = (
        fdi_config.fault_profile == "abrupt",
        declared.substeps,
    )


def configure_layout(
    layout: np.void, estimator_entries: Sequence[tuple[str, int, int]], aircraft: Aircraft
) -> None:
    """Fill in axes, groups and estimators of the surfaces; estimator_entries: of isolation.py."""
    surface_index_by_name = {name: s for s, name in enumerate(aircraft.surfaces)}
    layout["main"] = main_surface_index_by_axis(aircraft)
    layout["dominant_axis"] = aircraft.dominant_axis
    layout["group"] = [
        PITCH_SURFACE_GROUP if axis == PITCH else LATERAL_SURFACE_GROUP for axis in aircraft.dominant_axis
    ]
    layout["partner"] = layout["loss_estimator"] = layout["position_estimator"] = -1
    for aircraft_group_surface_names in aircraft.groups.values():
        if len(aircraft_group_surface_names) == 2:
            index_of_first_surface_in_group, index_of_second_surface_in_group = (
                surface_index_by_name[name] for name in aircraft_group_surface_names
            )
            layout["partner"][index_of_first_surface_in_group] = index_of_second_surface_in_group
            layout["partner"][index_of_second_surface_in_group] = index_of_first_surface_in_group
    for estimator_index, (_, kind, surface_index) in enumerate(estimator_entries):
        layout["loss_estimator" if kind == LOSS else "position_estimator"][surface_index] = estimator_index


_COMPILED_DETECTOR_ENTRY_BY_NAME = compiled_rows(DETECTORS)
_PLUGIN_SCHEME_KERNEL_PATH = (
    f"{__package__}.schemes.adaptive_estimators:PYTHON_PLUGIN"  # of every Python plug-in
)
SCHEME_KERNEL_PATHS = (
    *dict.fromkeys(row["kernels"] for row in _COMPILED_DETECTOR_ENTRY_BY_NAME.values()),
    _PLUGIN_SCHEME_KERNEL_PATH,
)
PLUGIN_SCHEME_NUMBER = SCHEME_KERNEL_PATHS.index(_PLUGIN_SCHEME_KERNEL_PATH)


def scheme_number(name: str) -> int:
    """Index of the path of a scheme's kernels in SCHEME_KERNEL_PATHS."""
    return (
        SCHEME_KERNEL_PATHS.index(_COMPILED_DETECTOR_ENTRY_BY_NAME[name]["kernels"])
        if name in _COMPILED_DETECTOR_ENTRY_BY_NAME
        else PLUGIN_SCHEME_NUMBER
    )
