"""What errors of the air data do to the accelerations, as the aircraft flies now.

A reading that is off by e moves f + G u by e times its derivative along that reading, to first order. The
derivative changes in flight: of the share e / qdyn of every moment a slow aircraft feels more, and of a
vane's error one that slips. A steady error is a constant times a known regressor, as that of a coefficient
is; noise is jitter. dpt, worked out from the engine's power, airspeed and dynamic pressure, is off with them.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.engine import DPT_0, KW_TO_DPT, density_ratio
from beaver_ftc.design.terms import AIRSPEED, ALPHA, BETA, DPT, PH, QDYN, RH, directional, whole_sum
from beaver_ftc.diagnosis.bounds.declared import Errors
from beaver_ftc.diagnosis.likelihood import LATERAL, N_READINGS, PITCH_BLOCK
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA

_SENSORS = {"alpha": ALPHA, "beta": BETA, "V": AIRSPEED, "qdyn": QDYN}
_POWER = N_READINGS - 1  # of the engine, kW
_SLIPSTREAM = RH + 1  # the first of the declared signals


def set_up_readings(statistical: np.void, errors: Errors, admitted: np.void) -> None:
    """Add the readings to the regressors of the blocks, which have those of their coefficients."""
    steady, noise = np.zeros(N_READINGS), statistical["noise"]["reading"]
    for name, place in _SENSORS.items():
        steady[place], noise[place] = errors[name].steady, errors[name].random
    steady[_POWER] = admitted["engine_kw"]  # all of it: so many standard deviations are part of that
    noise[_POWER] = admitted["engine_kw"] / NOISE_LIMIT_SIGMA
    if not (steady.any() or noise.any()):
        return
    statistical["noise"]["read"] = statistical["tests"]["tolerated"] = 1
    for block in statistical["block"]:
        n = int(block["n_regressors"])
        block["n_regressors"], block["tolerance"][n : n + N_READINGS] = n + N_READINGS, steady


@kernel
def sensitivity(table, admitted, y, which, direction):
    """Fill direction (N_SIGNALS,) with what the signals of a table change by per unit of a reading."""
    direction[:] = 0.0
    V, qdyn = y[AIRSPEED], y[QDYN]
    if which < AIRSPEED:  # a vane
        direction[which] = 1.0
    if which == AIRSPEED:
        for k in range(PH, RH + 1):
            direction[k] = -table.signal[k] / V
    if admitted.engine and which >= AIRSPEED:
        per_kw = KW_TO_DPT / (qdyn * V)
        thin = per_kw * admitted.thin_air_kw * density_ratio(y)
        if which == AIRSPEED:
            direction[_SLIPSTREAM] = (2.0 * thin - (y[DPT] - DPT_0)) / V
        elif which == QDYN:
            direction[_SLIPSTREAM] = -(thin + y[DPT] - DPT_0) / qdyn
        else:
            direction[_SLIPSTREAM] = per_kw


@kernel
def moved(design, y, u, which, slope, out):
    """Fill out (3,) rad/s2 with what the accelerations change by per unit of a reading, the monomials by
    `slope`."""
    table, force = design.moments, y[QDYN] * design.S
    for i in range(3):
        out[i] = whole_sum(table, i, slope, u)
        if which == QDYN:
            out[i] += whole_sum(table, i, table.power, u) / y[QDYN]
    L, M, N = force * design.b * out[0], force * design.c * out[1], force * design.b * out[2]
    out[0], out[1], out[2] = design.Pl * L + design.Pn * N, design.Qm * M, design.Rl * L + design.Rn * N


@kernel
def add(share, noise, blocks, admitted, design, y, u):
    """Add this instant, a `share` of the frame, to the readings' regressors, rad/s2 per unit, and fill the
    jitter, rad2/s4, as it is now; `design.moments` is evaluated there."""
    table, out = design.moments, noise.moved
    noise.jitter[:] = noise.own_jitter
    for which in range(N_READINGS):
        sensitivity(table, admitted, y, which, noise.direction)
        directional(table, table.signal, table.power, noise.direction, noise.slope)
        moved(design, y, u, which, noise.slope, out)
        for i in range(3):
            noise.jitter[i] += (out[i] * noise.reading[which]) ** 2
        pitch = blocks[PITCH_BLOCK]
        pitch.regressor[pitch.n_regressors - N_READINGS + which, 0] += share * out[1]
        for b in range(LATERAL, blocks.size):
            block = blocks[b]
            j = block.n_regressors - N_READINGS + which
            block.regressor[j, 0] += share * out[0]
            block.regressor[j, 1] += share * out[2]
