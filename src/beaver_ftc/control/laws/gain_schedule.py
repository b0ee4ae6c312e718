"""The table of gains of the default law (rejecting.py) over dynamic pressure.

A row of the tables is a loop: an axis with the surface s that moves it. The rows are roll, pitch, yaw and, if
a surface can stand in, pitch by that surface. A column is a point of the schedule, an airspeed of the
envelope. loop_design.py finds the fastest Kp of a loop that margins and noise allow.

    Kp                       1/s       gain of the feedback
    L_rate, L_disturbance    1, 1/s    gains of the observer (`loop_design.corrections`)
    y                        (n_y,)    signals measured in trim (design/table.py)
"""

from math import exp, sqrt

import numpy as np

from beaver_ftc.aircraft import AXES, PITCH
from beaver_ftc.compiled import fill, kernel
from beaver_ftc.control.laws.evidence import derive_fading
from beaver_ftc.control.laws.loop_design import Loop, corrections, fastest, lead_of
from beaver_ftc.control.thrust import between
from beaver_ftc.design.plain_model import effectiveness, own_damping
from beaver_ftc.design.table import AIRSPEED, QDYN
from beaver_ftc.diagnosis.model_prediction import DEFAULT_RATE_RAD_S, servo_data
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.sensors import RateGyro

N_POINTS = 5  # points of the schedule over dynamic pressure
N_LOOPS = 4  # rows of the tables of gains: roll, pitch, yaw, and pitch by the surface that stands in
STAND_IN = 3  # the last of these rows


def configure(law: np.void, control: np.void, prediction: np.void, declared: Declared, y: np.ndarray) -> None:
    """Fill the law's configuration (control.CompiledLaw; fields: `rejecting.config_dtype`): the lead of each
    surface, and the gains of each loop at each point of the schedule.

    approach (n,): share of the way to its command that a surface goes in a frame. G (points, 3, n) rad/s2 per
    rad. keep: pole of a gyro's lag over a frame, exp(-bandwidth dt); 0 for a gyro without lag.
    """
    config = law["config"]
    layout = control["layout"]
    design = prediction["design"]
    dt = 1.0 / declared.rate_hz
    share = 1.0 / declared.substeps
    points = schedule_points(declared, y)
    G = np.array([effectiveness(design, point) for point in points])
    approach = 1.0 - (1.0 - prediction["actuators"]["approach"]) ** declared.substeps
    lead = [lead_of(float(share_of_way)) for share_of_way in approach]
    fill(config, dt=dt, share=share, qdyn=points[:, QDYN], fading=derive_fading(dt), lead=lead)
    loops = list(enumerate(layout["main"].tolist()))
    if layout["stand_in"] >= 0:
        loops.append((PITCH, int(layout["stand_in"])))
    speed_rad_s = allowed_speeds(declared, loops, np.abs(own_damping(design, y)))
    margin = declared.control.gain_margin_db, declared.control.phase_margin_deg
    for row, (axis, s) in enumerate(loops):
        gyro: RateGyro = getattr(declared.instruments, AXES[axis])
        keep = exp(-gyro.bandwidth_rad_s * dt) if gyro.bandwidth_rad_s else 0.0
        loop = Loop(dt, share, float(approach[s]), config["lead"][s], gyro.delay_s, keep)
        for j in range(N_POINTS):
            Kp = fastest(loop, margin, gyro.random_error, float(G[j, axis, s]), speed_rad_s[s])
            config["Kp_at"][row, j] = Kp
            config["L_rate_at"][row, j], config["L_disturbance_at"][row, j] = corrections(Kp, dt)


def schedule_points(declared: Declared, y: np.ndarray) -> np.ndarray:
    """The signals at the points of the schedule, (N_POINTS, n_y): those in trim, except airspeed V m/s, which
    spans the envelope, and dynamic pressure, Pa, which goes with V^2."""
    points = np.tile(y, (N_POINTS, 1))
    points[:, AIRSPEED] = V = np.linspace(*declared.aircraft.envelope.airspeed_mps, N_POINTS)
    points[:, QDYN] = y[QDYN] * (V / y[AIRSPEED]) ** 2
    return points


def allowed_speeds(declared: Declared, loops: list[tuple[int, int]], D: np.ndarray) -> dict[int, float]:
    """The speed, rad/s, at which the noise of a gyro may move the surface s of each loop (axis, s):

        noise_share sqrt(D_axis / D_max) rate limit        D (3,) 1/s: own damping of the axes; D_max: largest

    A surface that leads two axes has the speed of the second one.
    """
    limits_rad_s = servo_data(declared)["rate_limit_rad_s"]
    share = declared.control.noise_share
    return {
        s: share * sqrt(D[axis] / D.max()) * float(limits_rad_s[s] or DEFAULT_RATE_RAD_S) for axis, s in loops
    }


@kernel
def schedule(config, memory, qdyn, transfer_share):
    """Fill the gains (3,) of the axes at a dynamic pressure qdyn, Pa; beyond the schedule, take those at its
    end. In pitch

        gain <- gain + transfer_share (gain of the stand-in - gain)

    transfer_share: the part of pitch that the stand-in carries.
    """
    for table, gains in (
        (config.Kp_at, memory.Kp),
        (config.L_rate_at, memory.L_rate),
        (config.L_disturbance_at, memory.L_disturbance),
    ):
        for i in range(3):
            gains[i] = between(qdyn, N_POINTS, config.qdyn, table[i])
        if transfer_share > 0.0:
            by_stand_in = between(qdyn, N_POINTS, config.qdyn, table[STAND_IN])
            gains[PITCH] += transfer_share * (by_stand_in - gains[PITCH])
