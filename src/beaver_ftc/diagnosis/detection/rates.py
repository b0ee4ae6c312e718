"""The rows of the rates (rows.py): roll, pitch and yaw acceleration, rad/s2, and what errors do to them.

An error e of an air-data reading changes f + G u by e times its derivative with that reading, to first order.
The derivative depends on the flight condition and is evaluated in flight. dpt is worked out from the engine's
power, airspeed and dynamic pressure, so it has their errors. Noise of the readings is model noise:

    Z_c <- Z_c + share dF_c      Q = Q0 + sum_j (dF_j sigma_j)^2, (rad/s2)2

Letters of the kernels:

    c, k, j     column of Z, an unknown constant; term; reading of the air data
    i, s        axis, surface
    share       of an instant in its frame: one over the number of instants
    eta, Q      bound on the uncertainty, rad/s2; variance of the noise, (rad/s2)2; both (3,)
    dF_c (3,)   acceleration per unit of the constant
    tab         table of the moments (design/table.py), with its signals s and monomials m_k
    y, u        readings; surfaces, rad
    err         declared errors (`bounds.errors_dtype`); model: the design model
    meas        record of the readings: y, and rates x (3,) rad/s
"""

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_SURFACES, MAX_TERMS
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.engine import slipstream_slopes
from beaver_ftc.design.model import accelerate
from beaver_ftc.design.table import (
    AIRSPEED,
    ALPHA,
    BETA,
    N_SIGNALS,
    PH,
    QDYN,
    RH,
    directional,
    evaluate,
    regressors,
    whole_sum,
)
from beaver_ftc.diagnosis.bounds import add_published_bound
from beaver_ftc.diagnosis.detection.rows import (
    MAX_COLUMNS,
    MAX_FORCE_REGRESSORS,
    N_INPUT_READINGS,
    RATES,
    RAW,
    VANED,
    VANELESS,
)
from beaver_ftc.diagnosis.error_map import extra_bound
from beaver_ftc.scenario.declared import SensorErrors
from beaver_ftc.scenario.sensors import NOISE_LIMIT_SIGMA

MIN_GYRO_STD_RAD_S = 1e-9  # noise of an exact gyro: with a variance of 0 the filters' S would be singular
# Mapped error that the filters assume outside the map. It is larger than the acceleration of any aircraft,
# and small enough for a covariance that also holds a noise of 1e-4.
OFF_MAP_RAD_S2 = 100.0
_READING_OF = {"alpha": ALPHA, "beta": BETA, "V": AIRSPEED, "qdyn": QDYN}
_KW_READING = N_INPUT_READINGS - 1  # of the engine, kW
_DPT = RH + 1  # the first of the declared signals

# The noise model: accelerations that are not caused by a fault.
NOISE_RECORD = record(
    # intensity of the drift that represents a bounded uncertainty, over the bound squared, 1/s
    q=float,
    # share of its bound by which the uncertainty changes in a frame if no surface moves
    rate0=float,
    G_trim=(3, MAX_SURFACES),  # magnitude of the effect of each surface in trim, rad/s2 per rad
    # variance by noise of all inputs of f + G u and of the gust estimate, and without the air data, (rad/s2)2
    Q=3, Q0=3,
    # whether errors of the air data count; deviation of their noise, in units of the readings
    noisy=int, sigma=N_INPUT_READINGS,
    # intermediate results of `add_constants`: dF, after the change of signals and monomials by a reading
    ds=N_SIGNALS, dm=MAX_MONOMIALS, zC=MAX_TERMS, dF=(3, MAX_COLUMNS),
)  # fmt: skip


def configure_rows(stat: np.void, errors: SensorErrors, tol: np.ndarray, err: np.void) -> None:
    """Fill the errors of the rates: R of the gyros, tolerances and noise of the air data, and the numbers n
    and `first` of the columns.

    tol (terms,): tolerances of the coefficients of the moments; err: declared errors, of `errors_dtype`. The
    readings of the air data count (`noisy`) if one of them has an error.
    """
    rows = stat["rows"]
    noise = stat["noise"]
    n = len(tol)
    rows["R"][:3] = [max(errors[name].random, MIN_GYRO_STD_RAD_S) ** 2 for name in AXES]
    rows["tol"][:n] = tol
    rows["first"] = n + N_INPUT_READINGS + np.array([0, MAX_FORCE_REGRESSORS + 1])
    reading_tol = rows["tol"][n : n + N_INPUT_READINGS]
    sigma = noise["sigma"]
    for name, j in _READING_OF.items():
        reading_tol[j] = errors[name].steady
        sigma[j] = errors[name].random
    # kw0 bounds the whole error of the power, so the noise is that over the standard deviations in a bound.
    reading_tol[_KW_READING] = err["kw0"]
    sigma[_KW_READING] = err["kw0"] / NOISE_LIMIT_SIGMA
    noise["noisy"] = reading_tol.any() or sigma.any()
    rows["n"] = n + noise["noisy"] * N_INPUT_READINGS if noise["noisy"] or tol.any() else 0


@kernel
def fill_signal_slopes(tab, err, y, j, ds):
    """Fill ds (N_SIGNALS,), the change of the table's signals s per unit of reading j of the air data:

    alpha, beta         ds_j = 1
    V                   ds_k = -s_k / V for the normalised rates k
    V, qdyn, kW         that of dpt (`slipstream_slopes`), if errors of the engine's instruments are declared
    """
    ds[:] = 0.0
    if j < AIRSPEED:  # a vane
        ds[j] = 1.0
    if j == AIRSPEED:
        for k in range(PH, RH + 1):
            ds[k] = -tab.signal[k] / y[AIRSPEED]
    if err.engine and j >= AIRSPEED:
        ds[_DPT] = slipstream_slopes(y, err.kw1)[j - AIRSPEED]  # the readings from airspeed on, in this order


@kernel
def fill_constants(noise, tab, err, y, u, first, n):
    """Fill dF (3, n), for now with the moments per unit of each constant, as coefficients.

        columns c < first                  monomial [u_s]      those of the axis' own terms
        columns first + j, of reading j    sum_k C_k dm_k [u_s]      qdyn: + sum_k C_k m_k [u_s] / qdyn

    C_k: coefficient; dm: change of the monomials by ds (`fill_signal_slopes`); [u_s]: in terms of a surface.
    """
    dF = noise.dF
    regressors(tab, tab.power, u, noise.zC)
    for i in range(3):
        dF[i, :n] = 0.0
        for k in range(tab.free_from[i], tab.surface_to[i]):
            dF[i, k] = noise.zC[k]
    for j in range(n - first):
        fill_signal_slopes(tab, err, y, j, noise.ds)
        directional(tab, tab.signal, tab.power, noise.ds, noise.dm)
        for i in range(3):
            dF[i, first + j] = whole_sum(tab, i, noise.dm, u)
            if j == QDYN:
                dF[i, first + j] += whole_sum(tab, i, tab.power, u) / y[QDYN]


@kernel
def add_constants(share, noise, rows, err, model, meas, u):
    """Add an instant, which is this share of the frame, to Z of the rates, rad/s2 per unit of each constant;
    if `noisy`, fill Q as it is at this instant.

        Z_c <- Z_c + share dF_c      Q = Q0 + sum_j (dF_j sigma_j)^2,  j: readings
    """
    n = rows.n
    if n == 0:
        return
    dF = noise.dF
    first = n - N_INPUT_READINGS * noise.noisy  # column of the first reading
    evaluate(model.moments, meas.x, meas.y)
    fill_constants(noise, model.moments, err, meas.y, u, first, n)
    accelerate(model, meas.y, dF[:, :n])
    for i in range(3):
        if noise.noisy:
            noise.Q[i] = noise.Q0[i]
        for c in range(n):
            rows.Z[c, i] += share * dF[i, c]
            if c >= first:
                noise.Q[i] += (dF[i, c] * noise.sigma[c - first]) ** 2


@kernel
def begin_rows(share, noise, rows, bound, model, meas, u):
    """Begin the rows of the next frame at this instant, which is this share of it: Z, eta and std[RATES].

    eta[0] = published bound + |G| du + min(mapped error, OFF_MAP_RAD_S2)
    eta[1] = eta[0], and, if one surface may be anywhere, the further error of the map over the whole travel

    |G| in trim; du rad: bounds on the deflections.
    """
    eta = rows.eta[0]
    emap = bound.error_map
    rows.Z[: rows.n] = 0.0
    add_constants(share, noise, rows, bound.declared_errors, model, meas, u)
    eta[:3] = 0.0
    add_published_bound(meas.x, model, bound.coupling_share, bound.const, bound.earth_rate_rad_s, eta)
    for i in range(3):
        for s, du in enumerate(bound.declared_errors.du):
            eta[i] += noise.G_trim[i, s] * du
        if emap.n_boxes > 0:
            eta[i] += min(emap.e_now[i], OFF_MAP_RAD_S2)
        rows.eta[1, i] = eta[i] + (extra_bound(emap, emap.n_levels - 1, i) if emap.one_free else 0.0)
        rows.std[RATES, i] = np.sqrt(noise.Q[i])


@kernel
def finish_rows(rows, noise, forces, gust, vaned, vaneless, bound, means, nu, per_cubed):
    """Fill the rows of the rates for the elapsed frame; nu (3,) rad/s2: their innovation.

        rows.nu[source] = nu - acc_mean of the gust estimate that the source subtracts
        std[RAW] = std[VANED] = sqrt(Q)      std[VANELESS] = std[RAW] + gust_noise

    gust, vaned, vaneless: the estimates that RATES, VANED (if forces are in use) and VANELESS subtract; RAW
    subtracts none. Q contains the noise of an estimate by vanes, so std[RAW] is an upper limit. `begin_rows`
    has filled std[RATES]. INERTIAL has no rows of the rates. means: of the prediction;
    G of a surface is that of the frame before, Gu the same times u of this frame (see `frame_means_dtype`).
    per_cubed: see ROWS_RECORD.
    """
    rows.per_cubed = per_cubed
    for i in range(3):
        rows.nu[RAW, i] = nu[i]
        rows.nu[RATES, i] = nu[i] - gust.output.acc_mean[i]
        rows.nu[VANED, i] = nu[i] - (vaned.output.acc_mean[i] if forces.in_use else 0.0)
        rows.nu[VANELESS, i] = nu[i] - vaneless.output.acc_mean[i]
        rows.std[RAW, i] = rows.std[VANED, i] = np.sqrt(noise.Q[i])
        # The deviation of a sum is at most the sum of the deviations, for any correlation of the noises.
        rows.std[VANELESS, i] = rows.std[RAW, i] + forces.gust_noise[i]
        for s in range(means.G.shape[1]):
            rows.G[s, i] = means.G_old[i, s]
            rows.Gu[s, i] = means.G_old[i, s] * means.u[s]
            rows.e_G[s, i] = bound.eG[i, s]
