"""The engine monitor: engines whose levers have one setting must not yaw the aircraft more than healthy ones.

It monitors engines that are effectors. Their moments are signals, which the design model contains, so the
innovation does not show an engine that fails. The monitor compares the yawing moment with the thrust. If all
levers have the same setting, a healthy aircraft has

    |Cn - a CT| <= bound + MAX_OFFSET_M / b |CT|,    a = -sum share right / b

    CT, Cn      coefficients of the thrust of all engines, and of its yawing moment
    b           span, m
    share       share of an engine in the thrust
    right       distance of an engine to the right of the centre of gravity, m

The derivation of an aircraft measures `bound` on healthy engines, for each box of the map of the model's
error. It is not zero, because in oblique flow a propeller makes a yawing moment of its own. The second term
is for fuel that is burnt from one side first. Beyond the limit an engine has failed, because no surface can
cause that. The monitor detects neither a failed engine on the centre line nor engines that fail alike.
"""

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import fill, kernel, record
from beaver_ftc.design.table import DPT

THRUST_SIGNAL, YAW_SIGNAL = "thrust", "engines_n"  # signals: CT and Cn
MAX_OFFSET_M = 0.05  # largest distance of the centre of gravity from the plane of symmetry, by fuel

# n_engines: number of engines, 0 if they are not monitored. i_T, i_n: places of CT and Cn in y.
# yaw_per_thrust: a, as the function of this name returns it. slack: MAX_OFFSET_M / b. levers_apart: whether a
# law has moved one lever away from the others. engine_failed: whether an engine has failed; it stays set.
ENGINE_MONITOR_RECORD = record(
    config=record(n_engines=int, i_T=int, i_n=int, yaw_per_thrust=float, slack=float),
    memory=record(levers_apart=int), output=record(engine_failed=int),
)  # fmt: skip


def yaw_per_thrust(aircraft: Aircraft) -> float:
    """a: Cn per CT of healthy engines whose levers have one setting."""
    moment = sum(effector.share * effector.right_m for effector in aircraft.effectors.values())
    return -moment / aircraft.geometry.span_m


def configure_engine_monitor(config: np.void, aircraft: Aircraft) -> None:
    """Fill `config` of the record; it stays empty where the symmetry of the engines is not measured."""
    error_map = aircraft.file.model_error_map
    signals = list(aircraft.signals)
    if error_map is None or not error_map.knows_engines or not {THRUST_SIGNAL, YAW_SIGNAL} <= set(signals):
        return
    i_T, i_n = (DPT + signals.index(name) for name in (THRUST_SIGNAL, YAW_SIGNAL))
    fill(
        config, n_engines=len(aircraft.effectors), yaw_per_thrust=yaw_per_thrust(aircraft), i_T=i_T, i_n=i_n,
        slack=MAX_OFFSET_M / aircraft.geometry.span_m,
    )  # fmt: skip


@kernel
def disable_if_apart(mon, levers):
    """Disable the monitor once a law has moved one lever away from the others; levers (n or more,): what each
    engine's lever has in addition to the common setting.
    """
    for i in range(mon.config.n_engines):
        mon.memory.levers_apart |= levers[i] != 0.0


@kernel
def detect_engine_failure(mon, asymmetry, y):
    """Latch `engine_failed` if the signals y (n_y,) of this frame exceed the limit, and return it:

        |Cn - a CT| > asymmetry + slack |CT|

    asymmetry: `bound` in the box of the map where the aircraft is.
    """
    c = mon.config
    if c.n_engines > 0 and not mon.memory.levers_apart:
        CT = y[c.i_T]
        if abs(y[c.i_n] - c.yaw_per_thrust * CT) > asymmetry + c.slack * abs(CT):
            mon.output.engine_failed = 1
    return mon.output.engine_failed == 1
