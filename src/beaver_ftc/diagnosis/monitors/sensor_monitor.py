"""The sensor monitor: finds the broken sensor by the redundancy of all sensors (redundancy.py).

It assumes that one sensor fails at a time. The test with the largest ratio of residual to bound raises the
alarm, and says which sensors are suspects (suspects.py). A suspect is excluded if its error would exceed
another test too, and that test is within its bound. Each sample since the alarm may exclude further ones, by
gyro_or_attitude.py and flow_or_force.py.

    outcome                sensor        surfaces
    a reading is missing   isolated      none is isolated
    one suspect            isolated      none is isolated
    several, or none       not isolated  none is isolated; after UNANTICIPATED_DELAY_S the verdict is
                                         "unanticipated"
    alarm long after that  isolated or   the conclusion about surfaces stays (MIN_LEAD_S)
    of the surfaces        not, as above

An isolated sensor is replaced by an estimate from the others (`estimate_reading`), for the diagnosis and for
the laws, until the end of the flight. Accelerometers are not replaced: the diagnosis uses none that may be
broken (`measured.inertial`).

    y, y_past        (N_SENSORS,) readings now, and in the sample before, SI
    h, dt            duration of a sample and of a frame, s
    i                sensor
    mon, o           record of the monitor (records.py), and its output
    pred, measured   prediction of the design model, readings of the sensors
    verdict, bank    the conclusion about surfaces, the detection filters
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.table import DPT
from beaver_ftc.diagnosis.detection import attitude
from beaver_ftc.diagnosis.monitors.flow_or_force import (
    FORCES,
    clear_sensors,
    count_same,
    stands_still,
)
from beaver_ftc.diagnosis.monitors.gyro_or_attitude import (
    FULL_STAGE,
    advance_gyro_estimate,
    advance_stage,
    exclude_gyros,
    filter_beyond,
    follow_gyro_errors,
    judge_gyros,
    restart_comparison,
)
from beaver_ftc.diagnosis.monitors.initial_errors import start_bounds, update_bounds
from beaver_ftc.diagnosis.monitors.numbering import (
    BETA_TEST,
    FILTER_POLES_PER_S,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    I_QDYN,
    NO_SENSOR,
    SPEED_TEST,
)
from beaver_ftc.diagnosis.monitors.redundancy import run_tests, start_tests, store_sample
from beaver_ftc.diagnosis.monitors.residual_bounds import MIN_AIRSPEED_MPS, too_steep
from beaver_ftc.diagnosis.monitors.suspects import find_suspects, latch_exceeded
from beaver_ftc.plant.instruments import (
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    N_SENSORS,
    set_inertial,
    share_out,
    slipstream_read,
)

MIN_LEAD_S = 0.5  # a surface detected this long before the alarm was detected with sound sensors
INITIAL_WINDOW_S = 1.0  # an alarm of the surfaces within this time from the start may be an initial error's
VANE_RETURN_S = 20.0  # time constant with which a replaced vane returns to trim: kinematics alone drift
RATE_POLE = 1  # index in FILTER_POLES_PER_S of the filter that gives the first value of a replaced rate


# One sample: test, compare, isolate, replace


@kernel
def expect_pressure(mon, pressure):
    """Predict the manifold pressure, inHg, from the command of the law in charge of the engine."""
    mon.sample.y_pred[MANIFOLD] = pressure


@kernel
def check_sensors(mon, pred, measured, verdict, bank, bound, dt, t):
    """Test the sensors at t s, and replace in `measured` the readings of broken ones. One call is one sample;
    a frame has `substeps` samples, the last of them at its end.

    bank: with the innovation of the elapsed frame, of dt s; bound: with the bound on that innovation. Both
    are new at the first sample of a frame, substep 0. The order matters: all comparisons are with y_past, the
    sample before, which `store_sample` replaces last, by readings that are then without the broken sensors.
    """
    y = measured.signal
    if not mon.dynamics.stage:
        start_monitor(mon, y, measured.force, t)
    else:
        if mon.substep == 0:
            advance_gyro_estimate(mon, bank.output.innovation, bound.eta_bar, dt)
        run_tests(mon, y, measured.fresh)
        update_bounds(mon, y)
        count_same(mon, y)
        follow_gyro_errors(mon)
        if too_steep(mon, y):
            restart_comparison(mon)
        else:
            advance_stage(mon)
            if mon.config.noisy:
                exclude_gyros(mon)
        isolate_sensor(mon, measured, verdict, bank, bound, dt, t)
        replace_readings(mon, pred, measured)
        store_sample(mon, y, measured.force)
    mon.substep = (mon.substep + 1) % mon.config.substeps


@kernel
def start_monitor(mon, y, force, t):
    """Start with the first sample y, force (3,) m/s2, at t s: no earlier sample can be compared with it."""
    mon.t_start = t
    mon.errors.e_drift = mon.errors.drift * t
    restart_comparison(mon)
    start_tests(mon, y, force)
    start_bounds(mon, y)


@kernel
def isolate_sensor(mon, measured, verdict, bank, bound, dt, t):
    """Raise the alarm, and isolate the sensor once it is the only suspect.

    A missing reading isolates its sensor. The test with the largest ratio beyond 1 raises the alarm. Each
    sample from then on may exclude suspects. The gyros are judged only at the first sample of a frame, where
    the innovation of the elapsed frame is new, and from FULL_STAGE on.
    """
    o = mon.output
    ratio = mon.tests.ratio
    worst = np.argmax(ratio)
    if mon.substep == 0 or ratio[worst] > o.top_ratio:  # of the samples of this frame
        o.worst_test_index = worst
        o.top_ratio = ratio[worst]
    for i in range(N_SENSORS):
        if measured.missing[i] and o.isolated_sensor == NO_SENSOR:
            mark_isolated(mon, verdict, i, t)
    if o.isolated_sensor != NO_SENSOR:
        return
    if o.top_ratio > 1.0 and not o.alarmed:
        raise_alarm(mon, verdict, t)
        o.alarm_test = o.worst_test_index
        mon.initial.E_alarm = mon.initial.E
    if o.alarmed:
        filter_beyond(mon, measured.signal)
        if mon.substep == 0 and mon.dynamics.stage == FULL_STAGE:
            judge_gyros(mon, bank, bound, dt)
        latch_exceeded(mon)
        if SPEED_TEST <= o.alarm_test <= BETA_TEST:
            clear_sensors(mon, measured.signal)
        find_suspects(mon)
        if o.suspect.sum() == 1:
            mark_isolated(mon, verdict, np.argmax(o.suspect), t)


@kernel
def raise_alarm(mon, verdict, t):
    """Raise the alarm of the sensors at t s, if it is not raised.

    A surface that was detected more than MIN_LEAD_S before was detected with sound sensors, and stays
    detected. If it was detected later, that conclusion is void, and the alarm dates from it.
    """
    o = mon.output
    if o.alarmed:
        return
    o.alarmed = 1
    o.alarmed_at_s = t
    if verdict.detected:
        o.keeps_surface = verdict.detected_at_s < t - MIN_LEAD_S
        if not o.keeps_surface:  # the rates have shown the same fault first
            o.alarmed_at_s = verdict.detected_at_s


@kernel
def mark_isolated(mon, verdict, i, t):
    """Isolate sensor i at t s, and raise the alarm if it is not raised."""
    raise_alarm(mon, verdict, t)
    mon.output.isolated_sensor = i
    mon.output.isolated_at_s = t
    mon.output.is_reading_unused[i] = 1


@kernel
def name_gyro(mon, verdict, i, t):
    """Isolate gyro i at t s, which attitude.py has found. The conclusion about surfaces is void, as the alarm
    of the surfaces was that of the gyro; not so if a surface has been isolated and `raise_alarm` keeps it."""
    o = mon.output
    mark_isolated(mon, verdict, i, t)
    if o.keeps_surface and verdict.isolated_estimator < 0:
        o.keeps_surface = 0
        o.alarmed_at_s = verdict.detected_at_s


@kernel
def add_turn(mon, att, y):
    """Add the residuals of turning of this sample, rad, to the comparison att of attitude and rates
    (attitude.py), and take over its turn_max. Near the vertical the attitude shows no turn: the comparison
    restarts, and turn_max, which is then not read, stays.
    """
    if too_steep(mon, y):
        attitude.restart(att)
        return
    attitude.add_turn(att, mon.tests.residual)
    mon.course.turn_max = att.turn_max


# What other parts of the diagnosis read of the monitor


@kernel
def has_alarm(mon):
    """Whether the monitor has raised its alarm; only an enabled monitor raises one."""
    return mon.output.alarmed


@kernel
def doubts_gyros(mon):
    """Whether a gyro may be the cause of the alarm of the surfaces. It is false for a monitor that is not
    enabled, whose `noisy` is 0."""
    return mon.config.noisy == 1 and mon.dynamics.gyros_excluded == 0


@kernel
def allows_isolation(mon, is_earlier, detected_at_s):
    """Whether a surface may be isolated after an alarm of the surfaces at detected_at_s, s.

    alarm within INITIAL_WINDOW_S of the start    no: a flow sensor may have had an error from the start,
                                                  and the design model uses its reading from then on
    a flow sensor stands still                    no: a surface that moves the aircraft moves its reading
    alarm in this frame (not `is_earlier`)        only if gyros are in doubt, because then the name waits;
                                                  a gyro's fault shows in the attitude one frame late
    otherwise, or if no monitor is enabled        yes
    """
    if not mon.config.enabled:
        return True
    if detected_at_s < mon.t_start + INITIAL_WINDOW_S:
        return False
    for i in (I_ALPHA, I_BETA, I_AIRSPEED, I_QDYN):
        if stands_still(mon, i):
            return False
    return is_earlier == 1 or doubts_gyros(mon)


# Substitutes of broken sensors


@kernel
def replace_readings(mon, pred, measured):
    """Replace the readings of isolated or missing sensors in `measured` by estimates from the others.

    Accelerometers, from AX on, are not replaced: none of them is used once one of them may be broken. The
    slipstream, which airspeed, dynamic pressure and the engine's sensors give, follows the replaced readings.
    """
    o = mon.output
    unused = o.is_reading_unused
    for i in range(N_SENSORS):
        unused[i] |= measured.missing[i]
        if unused[i] and i < AX:
            measured.signal[i] = estimate_reading(mon, pred, measured.signal, i)
    for i in FORCES:
        if unused[i] or (o.alarmed and o.suspect[i]):
            set_inertial(measured, 0)
    if unused[:AX].any():
        share_out(measured)
    slipstream = unused[I_AIRSPEED] or unused[I_QDYN] or unused[ENGINE_SPEED] or unused[MANIFOLD]
    if slipstream and mon.config.has_engine:
        measured.y[DPT] = slipstream_read(measured)


@kernel
def estimate_reading(mon, pred, y, i):
    """The estimate of a sensor's reading from the other sensors, in its unit:

    rates       `estimate_rate`
    airspeed    sqrt(2 qdyn / rho), at least MIN_AIRSPEED_MPS
    qdyn        rho airspeed^2 / 2        in both rho = 2 qdyn / airspeed^2 of the sample before
    vanes       the prediction of redundancy.py, returning to trim with the time constant VANE_RETURN_S
    others      the prediction of redundancy.py
    """
    if i < 3:
        return estimate_rate(mon, pred, i)
    sample = mon.sample
    rho = 2.0 * sample.y_past[I_QDYN] / sample.y_past[I_AIRSPEED] ** 2
    if i == I_AIRSPEED:
        return np.sqrt(max(2.0 * y[I_QDYN] / rho, MIN_AIRSPEED_MPS**2))
    if i == I_QDYN:
        return 0.5 * rho * y[I_AIRSPEED] ** 2
    back = mon.config.h / VANE_RETURN_S if i in (I_ALPHA, I_BETA) else 0.0
    return sample.y_pred[i] + back * (mon.config.y_trim[i] - sample.y_pred[i])


@kernel
def estimate_rate(mon, pred, i):
    """Body rate about axis i, rad/s, for a gyro that is marked as replaced: the rate of the sample before,
    corrected by the attitude, and its change since by the model:

        y_i = y_past_i + gain residual_i / h + h acc_i,    acc = f + G u [+ F_known - F]

    acc rad/s2: acceleration by the model, with the effect of surface faults if that conclusion stays; gain:
    `rate_gain`; u (n,) rad: positions in the sample before. The estimate is the y_past of the next sample,
    whose residual shows its error. In the first sample the reading of the broken gyro is still in y_past: if
    the attitude is noisy (gain < 1), the filtered residual times its pole, lam r, then takes the place of
    gain residual / h.
    """
    gain = mon.config.rate_gain
    h = mon.config.h
    acc = pred.f[i]
    for s, u in enumerate(pred.u_old):
        acc += pred.G[i, s] * u
    if mon.output.keeps_surface:
        acc += pred.F_known[i] - pred.means.F[i]
    rate = gain * mon.tests.residual[i] / h
    if not mon.gyro[i].replaced and gain < 1.0:
        rate = FILTER_POLES_PER_S[RATE_POLE] * mon.tests.r[i, RATE_POLE]
    mon.gyro[i].replaced = 1
    return mon.sample.y_past[i] + rate + h * acc
