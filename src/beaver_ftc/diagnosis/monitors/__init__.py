"""Monitors of what is not a control surface: sensors by their redundancy, engines by their symmetry.

The monitor of the engines is in this file. Engines under one lever that thrust unlike yaw the aircraft. The
moments of engines that are effectors are signals, which the innovation does not contain. They are compared
with the thrust. With all levers alike, a healthy aircraft has

    |Cn - a CT| <= bound + MAX_OFFSET_M / b |CT|,    a = -sum share right / b

CT, Cn: coefficients of thrust and of its yawing moment; b m: span; right m: place of an engine. bound:
measured where the terms were derived, box by box of the map of the model's error (propellers yaw aslant); the
second term is for fuel that burns from one side first. Beyond the limit an engine has failed: no surface can
do that. An engine in the middle does not show, nor do engines that fail alike.
"""

from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.table import DPT
from beaver_ftc.diagnosis.state import fill
from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.monitors.numbering import N_EQUATIONS, RPM_TEST
    from beaver_ftc.diagnosis.monitors.redundancy import COMPARISON_ROUNDING
else:
    __getattr__, __dir__ = lazily(__name__)


THRUST_SIGNAL, YAW_SIGNAL = "thrust", "engines_n"  # signals: CT and Cn
MAX_OFFSET_M = 0.05

# n_engines: engines, 0 where they are not monitored. i_T, i_n: places of CT and Cn in y. yaw_per_thrust: a.
# slack: MAX_OFFSET_M / b. levers_apart: a law has moved an engine apart, so the levers are no longer alike.
ENGINE_MONITOR_RECORD = record(
    config=record(n_engines=int, i_T=int, i_n=int, yaw_per_thrust=float, slack=float),
    memory=record(levers_apart=int), output=record(engine_failed=int),
)  # fmt: skip


def yaw_per_thrust(aircraft: Aircraft) -> float:
    """a: the yawing moment of the thrust with all levers alike, per CT."""
    moment = sum(effector.share * effector.right_m for effector in aircraft.effectors.values())
    return -moment / aircraft.geometry.span_m


def configure_balance(config: np.void, aircraft: Aircraft) -> None:
    """Fill `config` of the record; it stays empty where the symmetry of the engines is not measured."""
    error_map, signals = aircraft.file.model_error_map, list(aircraft.signals)
    if error_map is None or not error_map.knows_engines or not {THRUST_SIGNAL, YAW_SIGNAL} <= set(signals):
        return
    i_T, i_n = (DPT + signals.index(name) for name in (THRUST_SIGNAL, YAW_SIGNAL))
    slack = MAX_OFFSET_M / aircraft.geometry.span_m
    n = len(aircraft.effectors)
    fill(config, n_engines=n, yaw_per_thrust=yaw_per_thrust(aircraft), i_T=i_T, i_n=i_n, slack=slack)


@kernel
def disable_if_apart(mon, levers):
    """Disable the monitor once a law has moved an engine apart; levers (n and more,): of each, in addition to
    the common one.
    """
    for i in range(mon.config.n_engines):
        mon.memory.levers_apart |= levers[i] != 0.0


@kernel
def detect_engine_failure(mon, asymmetry, y):
    """Whether an engine has failed, by these signals y or before; asymmetry: bound on |Cn - a CT| here."""
    c = mon.config
    if c.n_engines > 0 and not mon.memory.levers_apart:
        CT = y[c.i_T]
        if abs(y[c.i_n] - c.yaw_per_thrust * CT) > asymmetry + c.slack * abs(CT):
            mon.output.engine_failed = 1
    return mon.output.engine_failed == 1
