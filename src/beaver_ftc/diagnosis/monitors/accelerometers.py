"""Is it an accelerometer that is broken, or the vane or the airspeed that it is held against?

Both move the same test of the flow. An accelerometer goes on adding: an error e makes up a velocity e t. What
a vane or the airspeed is off by comes once, and its reading has it. So from the alarm on

    an accelerometer is cleared where the reading of the flow has leapt as the test has, soon after the alarm,
    and none of theirs of late; where the former stands still; for the airspeed, where the density shows it
    a reading of the flow is cleared where the residuals add up to many times what it has moved by; where an
    airspeed, or incidence, as wrong as that would show in density, or climb; or where an accelerometer stands
    still

Which accelerometer it is follows from the direction of the velocity that is made up. Where nothing tells, no
instrument is named. None that may be broken is used: `measured.inertial`.
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

SOON_S = 1.0  # after the alarm: later, chance has had too many tries
CALMED_S = 2.0  # in which a leap of an accelerometer is forgotten
GOES_ON = 30.0  # times what the reading has moved by: a scale error within 3 % of -1 would do that
CLEARLY = 3.0  # beyond a bound, of what is not seen
_ROUNDING_S = 1e-9


@kernel
def instrument_of(test):
    """The instrument that a test of the flow holds against the accelerometers."""
    if test == SPEED:
        return AIRSPEED
    return ALPHA if test == ALPHA_FLOW else BETA


@kernel
def hypothesis_of(test):
    """That this instrument was broken when the watch began (since_start.py)."""
    if test == SPEED:
        return OF_SPEED
    return OF_ALPHA if test == ALPHA_FLOW else OF_BETA


@kernel
def of_the_flow(test):
    """Whether a test is one of those that accelerometers move."""
    return SPEED <= test <= BETA_FLOW


@kernel
def note_stillness(watch, signal):
    """Count the looks for which each reading (N_SENSORS,) has been the very same; and how far accelerometers
    have leapt in a look of late, m/s2."""
    watch.memory.restless *= 1.0 - watch.step.config.h / CALMED_S
    for i in range(N_SENSORS):
        watch.memory.still[i] = watch.memory.still[i] + 1 if signal[i] == watch.step.memory.then[i] else 0
        if AX <= i < N_IN_EQUATIONS:
            watch.memory.restless = max(watch.memory.restless, abs(signal[i] - watch.step.memory.then[i]))


@kernel
def stands_still(watch, i):
    """Whether instrument i is frozen: no sound one gives the same reading for so long."""
    return watch.memory.still[i] >= watch.config.longest_still[i]


@kernel
def weigh(watch, signal):
    """Clear instruments of the flow, or accelerometers, by this look, that of the alarm or a later one."""
    if not of_the_flow(watch.output.lead):
        return
    if watch.memory.gathering * watch.step.config.h < SOON_S - _ROUNDING_S and leapt(watch, signal):
        clear_accelerometers(watch)
    gather(watch, signal)
    flow = instrument_of(watch.output.lead)
    if stands_still(watch, flow) or (watch.output.lead == SPEED and watch.memory.fired[DENSITY]):
        clear_accelerometers(watch)
    frozen = False
    for i in range(AX, N_IN_EQUATIONS):
        frozen = frozen or stands_still(watch, i)
    if frozen or goes_on(watch) or would_show_elsewhere(watch, signal):
        watch.memory.cleared[flow] = 1


@kernel
def clear_accelerometers(watch):
    """None of them is it."""
    watch.memory.cleared[AX:] = 1


@kernel
def leapt(watch, signal):
    """Whether the residual is more than accelerometers make in a look, and in the reading, not in theirs."""
    i, step = instrument_of(watch.output.lead), watch.step
    per_m_s = 1.0 if watch.output.lead == SPEED else 1.0 / max(step.memory.then[AIRSPEED], 1.0)
    test, per_m_s2 = step.test[watch.output.lead], step.config.h * per_m_s
    second = signal[i] - 2.0 * step.memory.then[i] + watch.memory.earlier[i]
    half, theirs = 0.5 * abs(test.residual), 1.5 * watch.memory.restless * per_m_s2
    return 2.0 * half > test.bound[0] + LEAP_M_S2 * per_m_s2 and abs(second) >= half > theirs


@kernel
def gather(watch, signal):
    """Add up the residuals of the flow after the look of the alarm, (3,), what sound instruments may have of
    them, what a first error of the reading may, and how far each reading has moved meanwhile."""
    step = watch.step
    for j in range(3):
        i, test = instrument_of(SPEED + j), step.test[SPEED + j]
        if watch.memory.gathering == 0:
            watch.memory.least[j] = watch.memory.most[j] = signal[i]
            watch.memory.sound[j] = 2.0 * test.noise + test.air * step.config.gust
            continue
        watch.memory.gathered[j] += test.residual
        of = hypothesis_of(SPEED + j)
        watch.memory.sound[j] += step.config.h * test.rate
        watch.memory.first[j] += watch.since.held[of] * watch.since.reach[of, SPEED + j]
        watch.memory.least[j], watch.memory.most[j] = (
            min(watch.memory.least[j], signal[i]),
            max(watch.memory.most[j], signal[i]),
        )
    excess = np.sign(watch.memory.gathered[1]) * max(
        abs(watch.memory.gathered[1]) - watch.memory.sound[1] - watch.memory.first[1], 0.0
    )
    fallen = step.config.h * signal[AIRSPEED] * excess * np.cos(signal[PHI]) * np.cos(signal[PHI + 1])
    for m in range(step.config.decay.size):
        watch.memory.fallen[m] = step.config.decay[m] * watch.memory.fallen[m] + fallen
    watch.memory.gathering += 1


@kernel
def goes_on(watch):
    """Whether the residuals add up to what no error of a reading is, that has moved by so much."""
    j = watch.output.lead - SPEED
    moved = watch.memory.most[j] - watch.memory.least[j]
    sound = watch.memory.sound[j] + watch.memory.first[j]
    return moved > 0.0 and abs(watch.memory.gathered[j]) > GOES_ON * moved + CLEARLY * sound


@kernel
def would_show_elsewhere(watch, signal):
    """Whether an airspeed as wrong as that would show in the density, or an incidence in the climb; neither
    does."""
    step = watch.step
    elsewhere = DENSITY if watch.output.lead == SPEED else CLIMB
    if watch.output.lead == BETA_FLOW or watch.memory.fired[elsewhere]:
        return False
    of = hypothesis_of(watch.output.lead)
    for m in range(step.config.decay.size):
        error, speed = abs(watch.memory.fallen[m]), step.test[SPEED]
        if watch.output.lead == SPEED:
            error = 2.0 * (abs(speed.filtered[m]) - speed.bound[m]) / max(signal[AIRSPEED], 1.0)
            error *= 1.0 - min(watch.since.held[of], 1.0)
        if error > CLEARLY * (step.test[elsewhere].bound[m] + hidden(watch.since, of, elsewhere, m)):
            return True
    return False


@kernel
def suspect_accelerometers(watch, shown):
    """Fill in which of them can be it: along whose axis there is most of the velocity made up; shown: a gyro
    explains it."""
    step, who = watch.step, watch.output.suspect
    alpha, beta, V = step.memory.then[ALPHA], step.memory.then[BETA], max(step.memory.then[AIRSPEED], 1.0)
    faster, down, aside = (
        watch.memory.gathered[0],
        V * np.cos(beta) * watch.memory.gathered[1],
        V * watch.memory.gathered[2],
    )
    made_up, size = watch.memory.made_up, 0.0
    made_up[0] = np.cos(alpha) * (np.cos(beta) * faster - np.sin(beta) * aside) - np.sin(alpha) * down
    made_up[1] = np.sin(beta) * faster + np.cos(beta) * aside
    made_up[2] = np.sin(alpha) * (np.cos(beta) * faster - np.sin(beta) * aside) + np.cos(alpha) * down
    doubt = watch.memory.sound[0] + V * (watch.memory.sound[1] + watch.memory.sound[2])
    frozen = -1
    for i in range(3):
        size = max(size, abs(made_up[i]))
        frozen = AX + i if stands_still(watch, AX + i) else frozen
    for i in range(AX, N_IN_EQUATIONS):
        along = frozen == i or (frozen < 0 and abs(made_up[i - AX]) + doubt >= 0.5 * size)
        who[i] = along and not shown and not watch.memory.cleared[i]


@kernel
def discard(watch, measured):
    """Have no accelerometer used once one may be broken."""
    for i in range(AX, N_IN_EQUATIONS):
        if watch.output.replaced[i] or (watch.output.alarmed and watch.output.suspect[i]):
            measured.inertial = 0
