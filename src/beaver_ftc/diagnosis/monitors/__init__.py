"""Monitors of what is not a control surface: sensors by their redundancy, engines by their symmetry.

The monitor of the engines is in this file. Engines under one lever that thrust unlike yaw the aircraft. The
moments of engines that are effectors are signals, which the innovation does not contain. They are compared
with the thrust. With all levers alike, a healthy aircraft has

    |Cn - a CT| <= bound + MAX_CENTRE_OF_MASS_OFFSET_M / b |CT|,    a = -sum share right / b

CT, Cn: coefficients of thrust and of its yawing moment; b m: span; right m: place of an engine. bound:
measured where the terms were derived, box by box of the map of the model's error (propellers yaw aslant); the
second term is for fuel that burns from one side first. Beyond the limit an engine has failed: no surface can
do that. An engine in the middle does not show, nor do engines that fail alike.
"""

from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import DPT
from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.monitors.redundancy import COMPARISON_ROUNDING, N_TESTS_WITH_EQUATION, RPM_TEST
else:
    __getattr__, __dir__ = lazily(__name__)


THRUST_SIGNAL_NAME, ENGINE_YAWING_MOMENT_SIGNAL_NAME = "thrust", "engines_n"  # signals: CT and Cn
MAX_CENTRE_OF_MASS_OFFSET_M = 0.05

# n_engines: engines, 0 where they are not monitored. thrust_index, yawing_moment_index: places of the signals
# in y. healthy_yawing_moment_per_thrust: a. yawing_moment_tolerance_per_thrust: of the bound, per CT.
ENGINE_MONITOR_CONFIG_RECORD = record(
    n_engines=int,
    thrust_index=int,
    yawing_moment_index=int,
    healthy_yawing_moment_per_thrust=float,
    yawing_moment_tolerance_per_thrust=float,
)
# A law has moved an engine apart: the levers are no longer alike.
ENGINE_MONITOR_MEMORY_RECORD = record(disabled_by_differential_thrust=int)
ENGINE_MONITOR_OUTPUT_RECORD = record(engine_failed=int)  # an engine has failed
ENGINE_MONITOR_RECORD = record(
    config=ENGINE_MONITOR_CONFIG_RECORD,
    memory=ENGINE_MONITOR_MEMORY_RECORD,
    output=ENGINE_MONITOR_OUTPUT_RECORD,
)


def healthy_yawing_moment_per_thrust(aircraft: Aircraft) -> float:
    """a: the yawing moment of the thrust with all levers alike, per CT."""
    return (
        -sum(effector.share * effector.right_m for effector in aircraft.effectors.values())
        / aircraft.geometry.span_m
    )


def configure_engine_monitor(config: np.void, aircraft: Aircraft) -> None:
    """Fill the record (dtype CONFIG); it stays empty where the symmetry of the engines is not measured."""
    model_error_map, aircraft_signal_names = aircraft.file.model_error_map, list(aircraft.signals)
    if (
        model_error_map is None
        or not model_error_map.knows_engines
        or not {THRUST_SIGNAL_NAME, ENGINE_YAWING_MOMENT_SIGNAL_NAME} <= set(aircraft_signal_names)
    ):
        return
    config["n_engines"], config["healthy_yawing_moment_per_thrust"] = (
        len(aircraft.effectors),
        healthy_yawing_moment_per_thrust(aircraft),
    )
    config["thrust_index"], config["yawing_moment_index"] = (
        DPT + aircraft_signal_names.index(signal_name)
        for signal_name in (THRUST_SIGNAL_NAME, ENGINE_YAWING_MOMENT_SIGNAL_NAME)
    )
    config["yawing_moment_tolerance_per_thrust"] = MAX_CENTRE_OF_MASS_OFFSET_M / aircraft.geometry.span_m


@kernel
def disable_if_differential_thrust(engine_monitor, lever_offsets):
    """Disable the monitor once a law has moved an engine apart; lever_offsets (n and more,): of each, in
    addition to the common one."""
    for engine_index in range(engine_monitor.config.n_engines):
        engine_monitor.memory.disabled_by_differential_thrust |= lever_offsets[engine_index] != 0.0


@kernel
def detect_engine_failure(engine_monitor, engine_asymmetry_bound, y):
    """Whether an engine has failed, by these signals y or before; engine_asymmetry_bound: on |Cn - a CT|
    here."""
    config = engine_monitor.config
    if config.n_engines > 0 and not engine_monitor.memory.disabled_by_differential_thrust:
        thrust_coefficient = y[config.thrust_index]
        if abs(
            y[config.yawing_moment_index] - config.healthy_yawing_moment_per_thrust * thrust_coefficient
        ) > engine_asymmetry_bound + config.yawing_moment_tolerance_per_thrust * abs(thrust_coefficient):
            engine_monitor.output.engine_failed = 1
    return engine_monitor.output.engine_failed == 1
