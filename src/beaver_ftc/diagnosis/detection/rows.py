"""What an instant says on five rows, and what a block or a view sees of it.

The rows are roll, pitch and yaw, of the rates (rates.py), and side force and normal force (forces.py); all in
rad/s2. On each of them an instant says

    nu = sum_s theta_s Gu_s + sum_j c_j Z_j + delta + noise      |c_j| <= tol_j,  |delta| <= eta

nu is the innovation; Gu_s the effect of surface s at its command, of which a loss takes the share -theta_s;
Z_j the effect of an unknown constant c_j: of a coefficient of the moments, of a reading of the air data, of a
term of a force; delta is a bounded uncertainty.

A block of the rates and a parity view both see these rows in one or two directions m (5,):

    m' nu,   m' Gu,   m' Z,   |m|' eta,   |m|' std,   m^2' R

std is the deviation of the noise of nu, R the variance of the noise of the gyros, (rad/s)2.

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
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.aircraft.schema import MAX_SURFACES, MAX_TERMS, MAX_TERMS_OF_ONE
from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.detection.blocks import ALPHA_CUBED_MOMENT, N_ROWS
from beaver_ftc.diagnosis.detection.directions import project, project_beyond_rounding, project_size

# Sources, that is, what is subtracted from the innovation of the rates:
#     RAW         nothing
#     RATES       the gust estimate of the blocks of the rates
#     VANED       the gust estimate of the views, by vanes
#     VANELESS    the gust estimate by accelerometers in place of vanes
#     INERTIAL    for views of a force alone, at the flow angle from inertial motion: the rates do not count
N_SOURCES = 5
RAW, RATES, VANED, VANELESS, INERTIAL = range(N_SOURCES)
N_INPUT_READINGS = 5  # alpha, beta, airspeed, dynamic pressure, engine power
# Columns of a force: its terms, the rate of sideslip, the bias of the accelerometer, the force as a whole.
MAX_FORCE_REGRESSORS = MAX_TERMS_OF_ONE + 3
MAX_COLUMNS = MAX_TERMS + N_INPUT_READINGS + 2 * (MAX_FORCE_REGRESSORS + 1)

ROWS_RECORD = record(
    nu=(N_SOURCES, N_ROWS), std=(N_SOURCES, N_ROWS),
    # bound on the uncertainty now: with surfaces as commanded, and with one of them anywhere in its travel
    eta=(2, N_ROWS), R=N_ROWS,
    # G: effect of each surface, then of an error of the side vane and of the other vane, per rad; e_G: bound
    # on the error of G
    G=(MAX_SURFACES + 2, N_ROWS), e_G=(MAX_SURFACES + 2, N_ROWS), Gu=(MAX_SURFACES, N_ROWS),
    per_cubed=float,  # pitch acceleration by a coefficient of 1 of alpha^3
    n=int, first=(int, 2),  # columns of the rates, 0 if no constant counts; first column of each force
    tol=MAX_COLUMNS, Z=(MAX_COLUMNS, N_ROWS),
)  # fmt: skip


def set_columns(b: np.void, rows: np.void, columns: list[int]) -> None:
    """Fill which columns of Z a block sees, and their tolerances."""
    n = len(columns)
    b["n_Z"] = b["n_columns"] = n
    b["columns"][:n] = columns
    b["tol"][:n] = rows["tol"][columns]


@kernel
def project_rows(b, rows):
    """Fill what block b sees of the rows of the elapsed frame, in each of its directions m (5,):

        nu = m' nu,  Q_x = (|m|' std)^2,  eta = |m|' eta,  R_y = m^2' R,  signature = m' Gu_s,
        regressor_j = m' Z_j

    A signature that is rounding alone is 0. The signature of a moment in alpha^3 is m per_cubed in pitch.
    Other hypotheses without a surface keep their signature.
    """
    for i in range(b.n):
        m = b.m[i]
        b.nu[i] = project(m, rows.nu[b.source])
        b.Q_x[i] = project_size(m, rows.std[b.source]) ** 2
        b.eta[i] = project_size(m, rows.eta[b.any_position])
        b.R_y[i] = 0.0
        for r in range(N_ROWS):
            b.R_y[i] += m[r] * m[r] * rows.R[r]
        for h in b.hypothesis[: b.n_h]:
            if h.surface >= 0:
                h.signature[i] = project_beyond_rounding(m, rows.Gu[h.surface])
            elif h.kind == ALPHA_CUBED_MOMENT:
                h.signature[i] = m[PITCH] * rows.per_cubed
        for j in range(b.n_columns):
            b.regressor[j, i] = project(m, rows.Z[b.columns[j]])


@kernel
def fill_leak(b, rows, leak, col):
    """Fill the last regressor of a view, leak col' nu, rad/s2: the share `leak` of nu along the column col
    (5,), which errors of that column let through (parity.py)."""
    b.regressor[b.n_Z - 1, 0] = leak * project(col, rows.nu[b.source])
