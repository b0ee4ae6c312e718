"""The engine symmetry monitor: engines under one lever that thrust unlike yaw the aircraft.

The moments of engines that are effectors are signals, which the innovation does not contain. They are
compared with the thrust. With all levers alike, a healthy aircraft has

    |Cn - a CT| <= bound + OFF_CENTRE_M / b |CT|,    a = -sum share right / b

CT, Cn: coefficients of thrust and of its yawing moment; b m: span; right m: place of an engine. bound:
measured where the terms were derived, box by box of the map of the model's error (propellers yaw aslant); the
second term is for fuel that burns from one side first. Beyond the limit an engine has failed: no surface can
do that. An engine in the middle does not show, nor do engines that fail alike.
"""

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import DPT

THRUST, YAWING = "thrust", "engines_n"  # signals: CT and Cn
OFF_CENTRE_M = 0.05

# n: engines, 0 where they are not monitored. thrust, yawing: places of the signals in y. arm: a. off_centre:
# of the bound, per CT.
ENGINE_CONFIG = record(n=int, thrust=int, yawing=int, arm=float, off_centre=float)
ENGINE_MEMORY = record(disabled=int)  # a law has moved an engine apart: the levers are no longer alike
ENGINE_OUTPUT = record(failed=int)  # an engine has failed
ENGINES = record(config=ENGINE_CONFIG, memory=ENGINE_MEMORY, output=ENGINE_OUTPUT)


def mean_arm(aircraft: Aircraft) -> float:
    """a: the yawing moment of the thrust with all levers alike, per CT."""
    return -sum(of.share * of.right_m for of in aircraft.effectors.values()) / aircraft.geometry.span_m


def configure_engine_monitor(config: np.void, aircraft: Aircraft) -> None:
    """Fill the record (dtype CONFIG); it stays empty where the symmetry of the engines is not measured."""
    known, signals = aircraft.file.model_error_map, list(aircraft.signals)
    if known is None or not known.knows_engines or not {THRUST, YAWING} <= set(signals):
        return
    config["n"], config["arm"] = len(aircraft.effectors), mean_arm(aircraft)
    config["thrust"], config["yawing"] = (DPT + signals.index(name) for name in (THRUST, YAWING))
    config["off_centre"] = OFF_CENTRE_M / aircraft.geometry.span_m


@kernel
def disable_if_differential_thrust(engines, levers):
    """Disable the monitor once a law has moved an engine apart; levers (n and more,): of each, in addition
    to the common one."""
    for e in range(engines.config.n):
        if levers[e] != 0.0:
            engines.memory.disabled = 1


@kernel
def detect_engine_failure(engines, bound, y):
    """Whether an engine has failed, by these signals y or before; bound: on |Cn - a CT| here."""
    config = engines.config
    if config.n > 0 and not engines.memory.disabled:
        thrust = y[config.thrust]
        if abs(y[config.yawing] - config.arm * thrust) > bound + config.off_centre * abs(thrust):
            engines.output.failed = 1
    return engines.output.failed == 1
