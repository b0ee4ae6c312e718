"""Separates a broken accelerometer from a broken vane or airspeed sensor.

A test of the flow (airspeed, incidence, sideslip) compares a flow sensor with the accelerometers, so an error
of either moves it. An accelerometer's error e integrates into a velocity error e t; an error of a flow sensor
is a step, which its own reading contains. From the alarm on

    the accelerometers are cleared if the reading of the flow sensor jumps as the test does, soon after the
    alarm, while no accelerometer has jumped; if the flow sensor is frozen; for the airspeed, if the test of
    the density is exceeded
    the flow sensor is cleared if the residuals add up to many times the range of its reading; if an airspeed,
    or incidence, of that error would exceed the test of the density, or of the climb; if an accelerometer is
    frozen

The direction of the spurious velocity says which accelerometer is broken. If neither is cleared, no sensor is
named. The diagnosis uses no accelerometer that may be broken: `measured.inertial`.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.monitors.sensor_records import (
    AIRSPEED,
    ALPHA,
    ALPHA_FLOW,
    BETA,
    BETA_FLOW,
    CLIMB,
    DENSITY,
    LEAP_M_S2,
    OF_ALPHA,
    OF_BETA,
    OF_SPEED,
    SPEED,
)
from beaver_ftc.diagnosis.monitors.since_start import hidden
from beaver_ftc.plant.instruments import AX, N_SENSORS, PHI
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS

SOON_S = 1.0  # after the alarm: later, a jump by chance is too likely
CALMED_S = 2.0  # time constant with which the largest jump of an accelerometer fades
GROWTH_FACTOR = 30.0  # residual sum over the range of the reading: a scale error within 3 % of -1 gives that
CLEARLY = 3.0  # times the bound of a test that is not exceeded
_ROUNDING_S = 1e-9


@kernel
def sensor_of(test):
    """The flow sensor that a test compares with the accelerometers."""
    if test == SPEED:
        return AIRSPEED
    return ALPHA if test == ALPHA_FLOW else BETA


@kernel
def hypothesis_of(test):
    """The hypothesis that this sensor was broken when the monitor began (since_start.py)."""
    if test == SPEED:
        return OF_SPEED
    return OF_ALPHA if test == ALPHA_FLOW else OF_BETA


@kernel
def is_flow_test(test):
    """Whether accelerometers take part in a test."""
    return SPEED <= test <= BETA_FLOW


@kernel
def count_identical_samples(monitor, signal):
    """Count the samples for which each reading (N_SENSORS,) has been the very same, and find the largest jump
    of an accelerometer from one sample to the next, m/s2, which fades within CALMED_S."""
    memory, before = monitor.memory, monitor.step.memory.then
    memory.largest_jump *= 1.0 - monitor.step.config.h / CALMED_S
    for i in range(N_SENSORS):
        memory.identical[i] = memory.identical[i] + 1 if signal[i] == before[i] else 0
        if AX <= i < N_IN_EQUATIONS:
            memory.largest_jump = max(memory.largest_jump, abs(signal[i] - before[i]))


@kernel
def is_frozen(monitor, i):
    """Whether sensor i is frozen: no sound one gives the same reading for so many samples."""
    return monitor.memory.identical[i] >= monitor.config.longest_identical[i]


@kernel
def weigh(monitor, signal):
    """Clear the flow sensor, or the accelerometers, by this sample, that of the alarm or a later one."""
    if not is_flow_test(monitor.output.lead):
        return
    since_alarm_s = monitor.memory.n_summed * monitor.step.config.h
    if since_alarm_s < SOON_S - _ROUNDING_S and reading_jumped(monitor, signal):
        clear_accelerometers(monitor)
    sum_residuals(monitor, signal)
    flow = sensor_of(monitor.output.lead)
    if is_frozen(monitor, flow) or (monitor.output.lead == SPEED and monitor.memory.exceeded[DENSITY]):
        clear_accelerometers(monitor)
    frozen = False
    for i in range(AX, N_IN_EQUATIONS):
        frozen = frozen or is_frozen(monitor, i)
    if frozen or residual_keeps_growing(monitor) or error_would_show_elsewhere(monitor, signal):
        monitor.memory.cleared[flow] = 1


@kernel
def clear_accelerometers(monitor):
    """Clear all accelerometers."""
    monitor.memory.cleared[AX:] = 1


@kernel
def reading_jumped(monitor, signal):
    """Whether the residual exceeds any jump of an accelerometer in one sample, and the flow sensor's reading
    jumps with it."""
    i, step = sensor_of(monitor.output.lead), monitor.step
    per_m_s = 1.0 if monitor.output.lead == SPEED else 1.0 / max(step.memory.then[AIRSPEED], 1.0)
    test, per_m_s2 = step.test[monitor.output.lead], step.config.h * per_m_s
    second = signal[i] - 2.0 * step.memory.then[i] + monitor.memory.earlier[i]
    half, theirs = 0.5 * abs(test.residual), 1.5 * monitor.memory.largest_jump * per_m_s2
    return 2.0 * half > test.bound[0] + LEAP_M_S2 * per_m_s2 and abs(second) >= half > theirs


@kernel
def sum_residuals(monitor, signal):
    """Add up, after the sample of the alarm, the residuals of the flow (3,), the part of sound sensors and
    that of an error that a reading has had from the start; and find the range of each reading."""
    step = monitor.step
    for j in range(3):
        i, test = sensor_of(SPEED + j), step.test[SPEED + j]
        if monitor.memory.n_summed == 0:
            monitor.memory.least[j] = monitor.memory.most[j] = signal[i]
            monitor.memory.sound_sum[j] = 2.0 * test.noise + test.air * step.config.gust
            continue
        monitor.memory.residual_sum[j] += test.residual
        of = hypothesis_of(SPEED + j)
        monitor.memory.sound_sum[j] += step.config.h * test.rate
        monitor.memory.first[j] += monitor.since.held[of] * monitor.since.reach[of, SPEED + j]
        monitor.memory.least[j], monitor.memory.most[j] = (
            min(monitor.memory.least[j], signal[i]),
            max(monitor.memory.most[j], signal[i]),
        )
    excess = np.sign(monitor.memory.residual_sum[1]) * max(
        abs(monitor.memory.residual_sum[1]) - monitor.memory.sound_sum[1] - monitor.memory.first[1], 0.0
    )
    fallen = step.config.h * signal[AIRSPEED] * excess * np.cos(signal[PHI]) * np.cos(signal[PHI + 1])
    for m in range(step.config.decay.size):
        monitor.memory.climb_error[m] = step.config.decay[m] * monitor.memory.climb_error[m] + fallen
    monitor.memory.n_summed += 1


@kernel
def residual_keeps_growing(monitor):
    """Whether the residuals add up to more than an error of a flow sensor whose reading has this range."""
    j = monitor.output.lead - SPEED
    moved = monitor.memory.most[j] - monitor.memory.least[j]
    sound = monitor.memory.sound_sum[j] + monitor.memory.first[j]
    return moved > 0.0 and abs(monitor.memory.residual_sum[j]) > GROWTH_FACTOR * moved + CLEARLY * sound


@kernel
def error_would_show_elsewhere(monitor, signal):
    """Whether an airspeed of this error would exceed the test of the density, or an incidence that of the
    climb, while that test is within its bound."""
    step = monitor.step
    elsewhere = DENSITY if monitor.output.lead == SPEED else CLIMB
    if monitor.output.lead == BETA_FLOW or monitor.memory.exceeded[elsewhere]:
        return False
    of = hypothesis_of(monitor.output.lead)
    for m in range(step.config.decay.size):
        error, speed = abs(monitor.memory.climb_error[m]), step.test[SPEED]
        if monitor.output.lead == SPEED:
            error = 2.0 * (abs(speed.filtered[m]) - speed.bound[m]) / max(signal[AIRSPEED], 1.0)
            error *= 1.0 - min(monitor.since.held[of], 1.0)
        if error > CLEARLY * (step.test[elsewhere].bound[m] + hidden(monitor.since, of, elsewhere, m)):
            return True
    return False


@kernel
def suspect_accelerometers(monitor, shown):
    """Suspect the accelerometers along whose axis most of the spurious velocity is; shown: a gyro explains
    it."""
    step, who = monitor.step, monitor.output.suspect
    alpha, beta, V = step.memory.then[ALPHA], step.memory.then[BETA], max(step.memory.then[AIRSPEED], 1.0)
    faster, down, aside = (
        monitor.memory.residual_sum[0],
        V * np.cos(beta) * monitor.memory.residual_sum[1],
        V * monitor.memory.residual_sum[2],
    )
    velocity, size, ahead = (
        monitor.memory.spurious_velocity,
        0.0,
        np.cos(beta) * faster - np.sin(beta) * aside,
    )
    velocity[0] = np.cos(alpha) * ahead - np.sin(alpha) * down
    velocity[1] = np.sin(beta) * faster + np.cos(beta) * aside
    velocity[2] = np.sin(alpha) * ahead + np.cos(alpha) * down
    doubt = monitor.memory.sound_sum[0] + V * (monitor.memory.sound_sum[1] + monitor.memory.sound_sum[2])
    frozen = -1
    for i in range(3):
        size = max(size, abs(velocity[i]))
        frozen = AX + i if is_frozen(monitor, AX + i) else frozen
    for i in range(AX, N_IN_EQUATIONS):
        along = frozen == i or (frozen < 0 and abs(velocity[i - AX]) + doubt >= 0.5 * size)
        who[i] = along and not shown and not monitor.memory.cleared[i]


@kernel
def discard(monitor, measured):
    """Mark the accelerometers as unusable once one of them may be broken."""
    for i in range(AX, N_IN_EQUATIONS):
        if monitor.output.replaced[i] or (monitor.output.alarmed and monitor.output.suspect[i]):
            measured.inertial = 0
