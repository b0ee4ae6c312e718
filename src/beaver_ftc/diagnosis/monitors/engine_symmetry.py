"""Whether engines under one lever pull alike: one that fails yaws the aircraft, and nothing else does so.

The moments of engines that are effectors are signals, which the innovation does not contain. So they are held
against the thrust beside them. With all levers where one is, in health

    |Cn - a CT| <= bound + OFF_CENTRE_M / b |CT|,    a = -sum share right / b

bound: measured where the terms were derived, box by box of the map of the model's error (propellers yaw
aslant); and for fuel burns from one side first. Beyond it an engine has failed: no surface can do that. An
engine in the middle does not show, nor do all that fail alike.
"""

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.terms import DPT
from beaver_ftc.diagnosis.detection.fdae import note_alarm
from beaver_ftc.diagnosis.state import UNANTICIPATED, YAW

THRUST, YAWING = "thrust", "engines_n"  # signals: CT and Cn
OFF_CENTRE_M = 0.05

# n: engines there are, 0: nothing is said of them. thrust, yawing: where the signals are in y. arm: a, and
# off_centre: of the bound, per CT. failed: one has.
BALANCE = record(n=int, thrust=int, yawing=int, arm=float, off_centre=float, failed=int)


def mean_arm(aircraft: Aircraft) -> float:
    """a: what thrust yaws by with all levers alike."""
    return -sum(of.share * of.right_m for of in aircraft.effectors.values()) / aircraft.geometry.span_m


def configure(balance: np.void, aircraft: Aircraft) -> None:
    """Fill the record (dtype BALANCE); it stays empty where nobody has measured how alike engines pull."""
    known, signals = aircraft.file.model_error_map, list(aircraft.signals)
    if known is None or not known.knows_engines or not {THRUST, YAWING} <= set(signals):
        return
    balance["n"], balance["arm"] = len(aircraft.effectors), mean_arm(aircraft)
    balance["thrust"], balance["yawing"] = (DPT + signals.index(name) for name in (THRUST, YAWING))
    balance["off_centre"] = OFF_CENTRE_M / aircraft.geometry.span_m


@kernel
def heed(balance, levers):
    """Say nothing more once a law has moved an engine apart; levers (n and more,): of each, beside the
    common one."""
    for e in range(balance.n):
        if levers[e] != 0.0:
            balance.n = 0


@kernel
def detect(balance, conclusion, bound, y, t):
    """Raise the alarm at t s, and name it `unanticipated`, if an engine has failed; bound: here."""
    if balance.n == 0 or conclusion.detected:
        return
    thrust = y[balance.thrust]
    if abs(y[balance.yawing] - balance.arm * thrust) > bound + balance.off_centre * abs(thrust):
        note_alarm(conclusion, YAW, t)
        conclusion.isolated, conclusion.isolated_at_s = UNANTICIPATED, t
        balance.failed = 1
