"""What an instant says on five rows, and what a block or a view sees of it.

The rows are roll, pitch and yaw, of the rates, and side force and normal force (forces.py); all in rad/s2. On
each of them an instant says

    nu = sum_s theta_s Gu_s + sum_j c_j Z_j + d + noise          |c_j| <= tol_j,  |d| <= eta

nu is the innovation; Gu_s the effect of surface s at its command, of which a loss takes the share -theta_s;
Z_j the effect of an unknown constant c_j: of a coefficient of the moments, of a reading of the air data, of a
term of a force; d is a bounded uncertainty.

A block of the rates and a parity view both see these rows in one or two directions m:

    m nu,   m Gu,   m Z,   |m| eta,   |m| std,   m^2 R

std is the deviation of the noise of nu, R the variance of the noise of the gyros, (rad/s)2.

An error e of an air-data reading changes f + G u by e times its derivative with that reading, to first order.
The derivative depends on the flight condition and is evaluated in flight. dpt is worked out from the engine's
power, airspeed and dynamic pressure, so it has their errors. Noise of the readings is model noise:

    Z_j <- Z_j + w dF_j      Q = Q0 + sum_j (dF_j sigma_j)^2, (rad/s2)2      dF_j: per unit of the constant

Z has these columns; a row that does not see a column has a zero there:

    0 ...           coefficients of the moments, then readings of the air data: rows.n of them, perhaps none
    first[0] ...    side force: coefficients, rate of sideslip, bias of the accelerometer if any, scale, drift
    first[1] ...    normal force: the same without the rate of sideslip

A frame has one instant or more; forces and views are used only if it has one. The rows of a frame are filled
in this order:

    at its start            update_forces: rows of the forces
                            begin_rows: of the rates Z, at the first instant, eta and std[RATES]
    at each instant inside  add_constants: of the rates Z is summed, and Q, if `noisy`, becomes that of now
    at its end              finish_rows: of the rates nu, G, Gu and the other std, from Q of the last instant
                            project_rows, fill_leak: the directions of each block and view

Letters of the kernels, in addition to those of statistical.py: r is a row, c a column of Z, k a term. Those
of the forces are in forces.py, but for the chord, which is `chord` here.
"""

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import FORCES
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
from beaver_ftc.diagnosis.detection.directions import project
from beaver_ftc.diagnosis.detection.forces import (
    MAX_FORCE_REGRESSORS,
    MIN_UPDATES,
    SIDE_INDEX,
    fill_angle_rates,
    update_inertial,
)
from beaver_ftc.diagnosis.detection.likelihood import ALPHA_CUBED_MOMENT, N_INPUT_READINGS, N_ROWS
from beaver_ftc.diagnosis.error_map import extra_bound
from beaver_ftc.diagnosis.state import PITCH, SIDE_FORCE
from beaver_ftc.scenario.declared import SensorErrors
from beaver_ftc.scenario.sensors import NOISE_LIMIT_SIGMA

# Sources, that is, what is subtracted from the innovation of the rates:
#     RAW         nothing
#     RATES       the gust estimate of the blocks of the rates
#     VANED       the gust estimate of the views, by vanes
#     VANELESS    the gust estimate by accelerometers in place of vanes
#     INERTIAL    for views of a force alone, at the flow angle from inertial motion: the rates do not count
RAW, RATES, VANED, VANELESS, INERTIAL = range(5)
MAX_COLUMNS = MAX_TERMS + N_INPUT_READINGS + 2 * (MAX_FORCE_REGRESSORS + 1)
# Largest time between the force and the flow of one instant in JSBSim; 0.001 s was measured.
MAX_FORCE_LAG_S = 0.002
MIN_GYRO_STD_RAD_S = 1e-9  # noise of an exact gyro: with a variance of 0 the filters' S would be singular
# Mapped error that the filters assume outside the map. It is larger than the acceleration of any aircraft,
# and small enough for a covariance that also holds a noise of 1e-4.
OFF_MAP_RAD_S2 = 100.0
_SIDE_ROW = FORCES.index("CY")
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
    # intermediate results of `add_constants`
    zC=MAX_TERMS, ds=N_SIGNALS, dm=MAX_MONOMIALS, C=(3, MAX_COLUMNS),
)  # fmt: skip

ROWS_RECORD = record(
    nu=(5, N_ROWS), std=(5, N_ROWS),  # by source: RAW to INERTIAL
    # bound on the uncertainty now: with surfaces as commanded, and with one of them anywhere in its travel
    eta=(2, N_ROWS), R=N_ROWS,
    # G: effect of each surface, then of an error of the side vane and of the other vane, per rad; e_G: bound
    # on the error of G
    G=(MAX_SURFACES + 2, N_ROWS), e_G=(MAX_SURFACES + 2, N_ROWS), Gu=(MAX_SURFACES, N_ROWS),
    per_cubed=float,  # pitch acceleration by a coefficient of 1 of alpha^3
    n=int, first=(int, 2),  # columns of the rates, 0 if no constant counts; first column of each force
    tol=MAX_COLUMNS, Z=(MAX_COLUMNS, N_ROWS),
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
        reading_tol[j], sigma[j] = errors[name].steady, errors[name].random
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
def add_constants(w, noise, rows, err, model, meas, u):
    """Add an instant, which is the share w of the frame, to Z of the rates, rad/s2 per unit of each constant;
    if `noisy`, fill Q as it is at this instant.

        Z_c <- Z_c + w dF_c      Q = Q0 + sum_j (dF_j sigma_j)^2,  j: readings

    dF (3, n): acceleration by the moments C (3, n), whose column c is per unit of constant c. For a
    coefficient that is its monomial, times the deflection of its surface, if it has one. For reading j it is

        sum_k A_k dm_k [u_s]      qdyn: + sum_k A_k m_k [u_s] / qdyn      A_k, m_k: coefficients and monomials

    with dm the change of the monomials by ds (`fill_signal_slopes`), and [u_s] in terms of a surface.
    """
    y = meas.y
    tab = model.moments
    C = noise.C
    n = rows.n
    if n == 0:
        return
    evaluate(tab, meas.x, y)
    regressors(tab, tab.power, u, noise.zC)
    first_reading = n - N_INPUT_READINGS * noise.noisy  # column of the first reading
    for i in range(3):
        C[i, :n] = 0.0
        for k in range(tab.free_from[i], tab.surface_to[i]):
            C[i, k] = noise.zC[k]
    for j in range(n - first_reading):
        fill_signal_slopes(tab, err, y, j, noise.ds)
        directional(tab, tab.signal, tab.power, noise.ds, noise.dm)
        for i in range(3):
            C[i, first_reading + j] = whole_sum(tab, i, noise.dm, u)
            if j == QDYN:
                C[i, first_reading + j] += whole_sum(tab, i, tab.power, u) / y[QDYN]
    accelerate(model, y, C[:, :n])
    for i in range(3):
        if noise.noisy:
            noise.Q[i] = noise.Q0[i]
        for c in range(n):
            rows.Z[c, i] += w * C[i, c]
            if c >= first_reading:
                noise.Q[i] += (C[i, c] * noise.sigma[c - first_reading]) ** 2


@kernel
def begin_rows(w, noise, rows, bound, model, meas, u):
    """Begin the rows of the next frame at this instant, which is the share w of it: Z, eta and std[RATES].

    eta[0] = published bound + |G| du + min(mapped error, OFF_MAP_RAD_S2)
    eta[1] = eta[0], and, if one surface may be anywhere, the further error of the map over the whole travel

    |G| in trim; du rad: bounds on the deflections.
    """
    eta = rows.eta[0]
    emap = bound.error_map
    rows.Z[: rows.n] = 0.0
    add_constants(w, noise, rows, bound.declared_errors, model, meas, u)
    eta[:3] = 0.0
    add_published_bound(
        meas.x, model, bound.inertia_coupling_error_share, bound.const, bound.earth_rate_rad_s, eta
    )
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
    G and Gu of surfaces are with the effects of the frame before (see `predict_force`). per_cubed: see
    ROWS_RECORD.
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
            rows.Gu[s, i] = means.Gu_old[i, s]
            rows.e_G[s, i] = bound.eG[i, s]


@kernel
def update_forces(rows, forces, gust, du, meas, u, dt):
    """Update the rows of the forces at this instant, dt s after the last.

        eta = q_ratio sum_s G_trim_s du_s + MAX_FORCE_LAG_S |f_hat'|

    u (n,) rad: surfaces; du (n,) rad: bounds on their errors; f_hat' rad/s3: change of the force over dt, 0
    at the first instant.

    The order matters: the force uses the flow's rates of the instant before, so `fill_angle_rates` comes
    last. At the first instant those are not known; the rates of this instant are used.
    """
    if forces.n_seen == 0:
        fill_angle_rates(forces, gust.config.gravity, meas)
    evaluate(gust.memory.table, meas.x, meas.y)
    forces.q_ratio = meas.y[QDYN] / forces.q_trim
    for i, f in enumerate(forces.component):
        r = SIDE_FORCE + i
        f_prev = f.f_hat
        predict_force(rows, forces, f, gust, i, meas, u)
        fill_force_row(rows, forces, f, r, meas.y[QDYN])
        rows.nu[INERTIAL, r] = update_inertial(forces, f, i, meas.y, dt)
        rows.Z[rows.first[i] + f.n_Z, r] = f.e_drift
        eta = 0.0
        for s in range(u.size):
            eta += f.G_trim[s] * du[s]
        e_lag = MAX_FORCE_LAG_S * abs(f.f_hat - f_prev) / dt if forces.n_seen else 0.0
        rows.eta[0, r] = rows.eta[1, r] = eta * forces.q_ratio + e_lag
    fill_angle_rates(forces, gust.config.gravity, meas)
    forces.n_seen = min(forces.n_seen + 1, MIN_UPDATES)


@kernel
def fill_force_row(rows, forces, f, r, qdyn):
    """Fill nu and std of row r, of the force f, for every source:

        nu = e (`innovation` of f)      std^2 = var_trim q_ratio^2 + (f_hat q_noise / qdyn)^2 + var_acc

    var_trim: with the noise of the vane, but for INERTIAL, which reads no vane; q_noise, qdyn Pa: noise and
    value of the dynamic pressure; var_acc: by the accelerometer. For INERTIAL, `update_forces` then replaces
    nu.
    """
    by_q = f.f_hat * forces.q_noise / qdyn
    for source in range(INERTIAL + 1):
        var = f.var_trim[int(source == INERTIAL)] * forces.q_ratio**2 + by_q * by_q + f.var_acc
        rows.nu[source, r] = f.innovation
        rows.std[source, r] = np.sqrt(var)


@kernel
def predict_force(rows, forces, f, gust, i, meas, u):
    """Predict force i, whose record is f, and fill its innovation a / chord - f_hat and the effects of
    surfaces:

        Gu_s = G_s u_s,  G_s of the instant before      at the first instant: of this one

    a m/s2: reading of the force's accelerometer. The rows have the effects of the frame before, as for the
    rates: the law reacts to the noise of a reading, which must not be in a signature too (statistical.md,
    "Signature from the previous frame").
    """
    r = SIDE_FORCE + i
    for s in range(u.size):
        rows.G[s, r] = f.G[s]
    f.f_hat = f_hat = add_terms(rows, forces, f, gust, i, meas, u)
    rows.Z[rows.first[i] + f.n_Z - 1, r] = f_hat
    for s in range(u.size):
        if forces.n_seen == 0:
            rows.G[s, r] = f.G[s]
        rows.Gu[s, r] = rows.G[s, r] * u[s]
    f.innovation = meas.force[1 + i] * forces.c_inv - f_hat


@kernel
def add_terms(rows, forces, f, gust, i, meas, u):
    """Fill the columns of the terms of force i, and the effects G of surfaces with the bounds e_G on their
    errors; return the predicted force f_hat, rad/s2.

        f_hat = sum_k C_k Z_k      Z_k = per_C monomial_k [u_s]      per_C = qdyn S / m chord
        G_s = sum_k C_k per_C monomial_k      e_G_s = sum_k tol_k |per_C monomial_k|      k: terms in u_s

    The column of term k is offset + k, so that the first term has the first column of the force. After the
    terms of the side force comes that in the rate of sideslip, f_bdot, which is added to f_hat, too.
    """
    table = gust.memory.table
    r = SIDE_FORCE + i
    first = table.free_from[_SIDE_ROW + i]
    end = table.surface_to[_SIDE_ROW + i]
    offset = rows.first[i] - first
    f_hat = 0.0
    per_C = meas.y[QDYN] * gust.config.S_m * forces.c_inv
    for s in range(u.size):
        rows.e_G[s, r] = f.G[s] = 0.0
    for k in range(first, end):
        s = table.surface[k]
        Z = per_C * table.power[table.monomial[k]]
        if s >= 0:
            f.G[s] += table.value[k] * Z
            rows.e_G[s, r] += rows.tol[offset + k] * abs(Z)
            Z *= u[s]
        rows.Z[offset + k, r] = Z
        f_hat += table.value[k] * Z
    if i == SIDE_INDEX:
        span_over_2V = gust.config.span / (2.0 * meas.y[AIRSPEED])
        f_bdot = per_C * forces.CY_bdot * forces.angle_rate[SIDE_INDEX] * span_over_2V
        rows.Z[offset + end, r] = f_bdot
        f_hat += f_bdot
    return f_hat


def set_columns(b: np.void, rows: np.void, columns: list[int]) -> None:
    """Fill which columns of Z a block sees, and their tolerances."""
    b["n_Z"], b["columns"][: len(columns)] = len(columns), columns
    b["tol"][: len(columns)] = rows["tol"][columns]


@kernel
def projection(m, i, X, k, size=False):
    """m_i X_k, row k of X (K, 5) in direction i of m (2, 5); |m_i| X_k if the rows of X are a `size`."""
    return project(m[i], X[k], size)


@kernel
def project_rows(b, rows):
    """Fill what block b sees of the rows of the elapsed frame, in each of its directions m (5,):

        nu = m nu,  Q_x = (|m| std)^2,  eta = |m| eta,  R_y = m^2 R,  signature = m Gu_s,  regressor_j = m Z_j

    The signature of a moment in alpha^3 is m per_cubed in pitch. Other hypotheses without a surface keep
    their signature.
    """
    m, source = b.m, b.source
    for i in range(b.n):
        b.nu[i] = projection(m, i, rows.nu, source)
        b.Q_x[i] = projection(m, i, rows.std, source, True) ** 2
        b.eta[i] = projection(m, i, rows.eta, b.any_position, True)
        b.R_y[i] = 0.0
        for r in range(N_ROWS):
            b.R_y[i] += m[i, r] * m[i, r] * rows.R[r]
        for h in b.hypothesis[: b.n_h]:
            if h.surface >= 0:
                h.signature[i] = projection(m, i, rows.Gu, h.surface)
            elif h.kind == ALPHA_CUBED_MOMENT:
                h.signature[i] = m[i, PITCH] * rows.per_cubed
        for j in range(b.n_Z):
            b.regressor[j, i] = projection(m, i, rows.Z, b.columns[j])


@kernel
def fill_leak(b, rows, leak, col):
    """Fill the last regressor of a view, leak col' nu, rad/s2: the share `leak` of nu along the column col
    (5,), which errors of that column let through (parity.py)."""
    b.regressor[b.n_Z - 1, 0] = leak * project(col, rows.nu[b.source], False)
