"""Parity tests: they exclude a surface for any type and time history of its fault.

A fault of surface s accelerates the aircraft along the column g_s of G only, rad/s2 per rad. A projection of
the innovation nu, rad/s2, on a parity direction m that is orthogonal to that column,

    m . nu        with  m . g_s = 0,  |m| = 1

does not depend on a fault of s. If a test finds a signal in this projection, s is not the (only) cause. Each
direction is a view: it has a whitening filter of its own and tests for a step, for a loss of another surface
(likelihood.py) and for an oscillation. The directions are

* each axis, for the surfaces that do not move it;
* in a plane that several surfaces move, the direction across the column g of each: m = (-g_2, g_1) / |g|. The
  planes are roll and yaw; if accelerometers are used (forces.py), also pitch and normal force, yaw and side
  force.

Declared errors may turn the column. Then a share of the innovation along the column leaks into the
projection, at most (|m_1| e_1 + |m_2| e_2) / (|g| - |m_2| e_1 - |m_1| e_2), where e_1 and e_2 bound the
errors of the surface's own terms, rad/s2 per rad. This share is tolerated like an error of a coefficient. A
test excludes at the alarm level, so noise and bounded uncertainty exclude as rarely as they raise an alarm.

The gust estimated from the vanes is subtracted from the rates only if the forces are measured. Without that
measurement a surface that does not follow its command produces a force that looks like a gust; then the
whole declared gust counts as noise. The rolling gust always does: no vane measures it.

An error of a vane changes a rate and its force, and so does the false gust estimate that it causes. If a view
uses a vane, it excludes a surface only after a view that is insensitive to the vane confirms it. That is a
view across the column of the vane, with the gust estimated from the forces, or a view of the force at the
flow angle that integrated inertial motion gives.

A broken accelerometer changes a force and no rate. If accelerometers may break (air.output.read is 0), a
force raises no alarm and gives no gust estimate; it only counts after an alarm of the rates. Forces that are
known or suspected to be wrong are not used.

*Oscillation tests.* They use the spectrum of a view's whitened innovation g at the frequencies of a grid.

An oscillating surface adds a tone of unknown amplitude and phase to a view. The whitening filter
is linear, so the whitened innovation contains the same tone. For each frequency w, rad/s, the test computes

    N = sum exp((i w - 1 / T) t) g / sqrt(S)          summed over past frames; t s is the age of a frame

with S the variance of g, (rad/s)2, and T = MEMORY_S. Without a fault the real and the imaginary part of N are
normal. With v the larger of their variances, |N| / sqrt(v) exceeds x with a probability of exp(-x^2 / 2) at
most. Two errors can add to |N| without a fault (symbols as in likelihood.py):

* Errors of coefficients add at most sum_j tol_j |R_j|, where R_j is the same sum over regressor j.
* A bounded uncertainty |d| <= eta_bar adds at most |W(w)| sum eta_bar exp(-t / T) |cos|, where W is the gain
  of the whitening filter at w. The limited rate of change of d reduces this a little (`bounded_gain_at`).

The sums are updated once per SUMMED_S: no frequency of the grid changes its phase much in that time.
"""

from collections.abc import Iterator
from math import exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_TERMS_OF_ONE
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.bounds import axis_of_term
from beaver_ftc.diagnosis.detection import forces, likelihood
from beaver_ftc.diagnosis.detection.forces import COMPONENTS, NORMAL, SETTLED_UPDATES, SIDE, force_terms
from beaver_ftc.diagnosis.detection.likelihood import (
    LATERAL,
    MAX_HYPOTHESES,
    N_READINGS,
    PITCH_BLOCK,
    STEP,
    Capacity,
    normalised_evidence,
)
from beaver_ftc.diagnosis.gusts import full_gust_drift, project_on_axis, remaining_gust_drift
from beaver_ftc.diagnosis.state import LOSS, NORMAL_FORCE, PITCH, ROLL, SIDE_FORCE, YAW

N_TONES = 16
# A memory of T s resolves frequencies 1 / T apart. A tone halfway between two frequencies of the grid appears
# with 0.7 of its amplitude.
MEMORY_S = 2.5
FREQUENCIES_RAD_S = np.linspace(1.0, 13.0, N_TONES)
SUMMED_S = 0.04
# Share of the alarm level reserved for noise in addition to a bounded uncertainty. It is reserved without
# noise too, because `whitening_gain` assumes constant gains, and the gains vary with a varying bound.
NOISE_SHARE = 0.5
# The tests run at airspeeds within this ratio of the trim airspeed, and at vane angles within this limit.
MAX_AIRSPEED_RATIO, MAX_INCIDENCE_RAD = 2.0, 0.5

# Configuration that all views share.
TONE_CONFIG = record(
    slowest=float, fastest=float,  # airspeeds, m/s, between which the tests run
    frames_per_sum=int, level=float,  # alarm level, standard deviations
    keep=float,  # factor by which a sum decays from one update to the next
    # (cos, sin) of the phase change per frame; per update, and twice that, both times `keep`
    rotation=(2, N_TONES), rotation_kept=(2, N_TONES), rotation_twice=(2, N_TONES),
    bounded_gain=N_TONES,  # largest mean of cos(w t) d(t) for a bounded uncertainty |d| <= 1
    noise_variance=N_TONES,  # larger variance of real and imaginary part of N; the sum of both is 1
)  # fmt: skip


@sized
def tones_dtype(regressors: int) -> np.dtype:
    """The oscillation tests of one view, for a number of regressors."""
    return record(
        count=int, sum=float, sums=regressors,  # frames since the last update; sums of g and of regressors
        tone=(2, N_TONES), overlap=(regressors, 2, N_TONES),  # N and R_j: real and imaginary parts
        # shares of |N| that errors of coefficients and a bounded uncertainty explain; for the latter, the
        # filtered bound: its mean, and its component at twice the frequency
        coefficient_part=N_TONES, uncertainty_part=N_TONES, bound_mean=N_TONES, bound_harmonic=(2, N_TONES),
        information=float,  # variance of N without a fault
        score=float,  # largest over the frequencies; on the scale of scores in likelihood.py
    )  # fmt: skip


@kernel
def is_within_envelope(tone_config, y):
    """True if airspeed and vane angles y (5,) are near those of normal flight.

    Outside, the tolerances of the tests, which are worked out for trim, do not hold.
    """
    within = tone_config.slowest < y[AIRSPEED] < tone_config.fastest
    return within and abs(y[ALPHA]) < MAX_INCIDENCE_RAD and abs(y[BETA]) < MAX_INCIDENCE_RAD


@kernel
def update_tones(view, tone_config, alarm_level, within_envelope, has_tolerances, dt):
    """Update the tests of a view with one frame, which the view's block has whitened; dt s.

    tolerated: true if the block has regressors. Without `within_envelope` the frame counts as zero, so the
    sums decay.
    """
    tones, block = view.tones, view.block
    n = block.n_regressors if has_tolerances else 0
    root = np.sqrt(block.S_inverse[0, 0]) if within_envelope else 0.0
    tones.sum += root * block.innovation[0]
    for j in range(n):
        tones.sums[j] += root * block.regressor_response[j, 0]
    tones.count += 1
    if tones.count < tone_config.frames_per_sum:
        return
    advance_resonators(tone_config, tones.tone, tones.sum)
    for j in range(n):
        advance_resonators(tone_config, tones.overlap[j], tones.sums[j])
        tones.sums[j] = 0.0
    tones.information = tone_config.keep * tone_config.keep * tones.information + tones.count
    update_uncertainty_part(tones, tone_config, block, root * view.bounded[0], dt)
    fill_coefficient_part(tones, block.tolerance, n)
    fill_score(tones, tone_config, alarm_level)
    tones.sum, tones.count = 0.0, 0


@kernel
def advance_resonators(tone_config, tone, drive):
    """Advance N at every frequency, tone (2, N_TONES), by one update: rotate, decay, add the drive."""
    rotation = tone_config.rotation_kept
    for f in range(tone.shape[1]):
        real, imaginary = tone[0, f], tone[1, f]
        tone[0, f] = rotation[0, f] * real - rotation[1, f] * imaginary + drive
        tone[1, f] = rotation[1, f] * real + rotation[0, f] * imaginary


@kernel
def whitening_gain(K_x, K_d, keep, cos, sin, dt):
    """Amplitude, rad/s, of the whitened response to a tone of amplitude 1 rad/s2, at constant filter gains.

    cos, sin: of the phase change of the tone per frame, of dt s.
    """
    apart = (cos - keep) * (cos - keep) + sin * sin
    real = 1.0 - (1.0 - K_x) * cos + dt * K_d * (cos - keep) / apart
    imaginary = (1.0 - K_x) * sin - dt * K_d * sin / apart
    return dt / np.sqrt(real * real + imaginary * imaginary)


@kernel
def update_uncertainty_part(tones, tone_config, block, bounded, dt):
    """Update `uncertainty_part`: the most that an uncertainty |d| <= bounded, in whitened units, adds to |N|.

    |cos x| = 2 / pi (1 + 2/3 cos 2x - 2/15 cos 4x + ...). A bound that varies at twice the tone's frequency
    adds most. Its higher harmonics add less: together no more than a third of that again.
    """
    rotation, keep, per_sum = tone_config.rotation_twice, tone_config.keep, bounded * tones.count
    for f in range(tones.uncertainty_part.size):
        cos, sin = tone_config.rotation[0, f], tone_config.rotation[1, f]
        bounded_input = per_sum * whitening_gain(block.K_x[0, 0], block.K_d[0, 0], block.keep, cos, sin, dt)
        real, imaginary = tones.bound_harmonic[0, f], tones.bound_harmonic[1, f]
        tones.bound_harmonic[0, f] = rotation[0, f] * real - rotation[1, f] * imaginary + bounded_input
        tones.bound_harmonic[1, f] = rotation[1, f] * real + rotation[0, f] * imaginary
        tones.bound_mean[f] = keep * tones.bound_mean[f] + bounded_input
        tones.uncertainty_part[f] = tone_config.bounded_gain[f] * (
            tones.bound_mean[f] + np.hypot(tones.bound_harmonic[0, f], tones.bound_harmonic[1, f])
        )


@kernel
def fill_coefficient_part(tones, tolerance, n):
    """Fill `coefficient_part`: the most that the declared errors of the first n coefficients add to |N|.

    The magnitude of R_j is at most its larger part plus (sqrt 2 - 1) times its smaller part.
    """
    tones.coefficient_part[:] = 0.0
    for j in range(n):
        overlap, tol = tones.overlap[j], tolerance[j]
        for f in range(tones.coefficient_part.size):
            one, other = abs(overlap[0, f]), abs(overlap[1, f])
            tones.coefficient_part[f] += tol * (max(one, other) + 0.41421356237309515 * min(one, other))


@kernel
def fill_score(tones, tone_config, alarm_level):
    """Fill `score` with the largest score over the frequencies, scaled to the detector's alarm level."""
    loudest = 0.0
    for f in range(tones.coefficient_part.size):
        evidence = np.hypot(tones.tone[0, f], tones.tone[1, f]) - tones.coefficient_part[f]
        variance = tone_config.noise_variance[f] * tones.information
        loudest = max(
            loudest,
            normalised_evidence(
                tone_config.level, NOISE_SHARE, evidence, tones.uncertainty_part[f], variance
            ),
        )
    tones.score = loudest * alarm_level / tone_config.level


def bounded_gain_at(frequency_rad_s: np.ndarray, pace_rad_s: float) -> np.ndarray:
    """Largest mean of cos(w t) d(t) over all d with |d| <= 1 and |d'| <= pace; frequencies w (n,) rad/s.

    The largest is reached by a square wave with edges of the slope `pace`, or, at frequencies where these
    edges do not reach 1, by a triangular wave.
    """
    x = frequency_rad_s / pace_rad_s
    return 2.0 / pi * np.where(x < pi / 2.0, np.sin(x), 1.0) / x


def configure_tones(
    tone_config: np.void, chance: float, airspeed_mps: float, pace_rad_s: float, dt_s: float
) -> None:
    """Fill the configuration that all views share.

    chance: probability of a false alarm granted to one test in one frame. airspeed_mps: in trim. pace_rad_s:
    largest rate of change of a bounded uncertainty, in bounds per second.
    """
    tone_config["bounded_gain"] = bounded_gain_at(FREQUENCIES_RAD_S, pace_rad_s)
    tone_config["slowest"], tone_config["fastest"] = (
        airspeed_mps / MAX_AIRSPEED_RATIO,
        airspeed_mps * MAX_AIRSPEED_RATIO,
    )
    frames_per_sum = max(round(SUMMED_S / dt_s), 1)
    angle = FREQUENCIES_RAD_S * dt_s
    keep = exp(-frames_per_sum * dt_s / MEMORY_S)
    tone_config["frames_per_sum"], tone_config["keep"], tone_config["level"] = (
        frames_per_sum,
        keep,
        sqrt(-2.0 * np.log(chance)),
    )
    tone_config["rotation"] = np.cos(angle), np.sin(angle)
    tone_config["rotation_kept"] = (
        keep * np.cos(frames_per_sum * angle),
        keep * np.sin(frames_per_sum * angle),
    )
    tone_config["rotation_twice"] = (
        keep * np.cos(2.0 * frames_per_sum * angle),
        keep * np.sin(2.0 * frames_per_sum * angle),
    )
    # The variances of the two parts differ by |sum exp(2 (i w - 1 / T) t)| / sum exp(-2 t / T).
    difference = (1.0 - keep**2) / np.abs(1.0 - keep**2 * np.exp(2j * frames_per_sum * angle))
    tone_config["noise_variance"] = 0.5 * (1.0 + difference)


VANE_TOLERANCE = 0.1  # relative error of the effect of a vane's error: its column is that of the trim
PEAK_MEMORY = 5.0  # time constant of `peak_score` over the one with which evidence is forgotten
MIN_FORCE_SHARE = 0.9  # component of a direction of length 1, above which a view counts as one of the force
MIN_COLUMN_LENGTH = 0.1  # least length that the errors leave of a column, as a share of its length
PITCH_PLANE, LATERAL_PLANE, YAW_PLANE = (PITCH, NORMAL_FORCE), (ROLL, YAW), (YAW, SIDE_FORCE)

# Values of `surface` in a view without one: a view of an axis; one across the column of an error of a vane.
AXIS_VIEW, VANE_VIEW = -1, -2


class RecordSize(NamedTuple):
    """Capacities of a record: of a block of the rates, of a view; numbers of views and of error-map boxes."""

    rates: Capacity
    view: Capacity
    views: int
    boxes: int


USUAL_SIZE = RecordSize(
    Capacity(23, MAX_HYPOTHESES), Capacity(36, 3), 13, 6
)  # enough for most aircraft: see `size_for`


@sized
def view_dtype(capacity: Capacity) -> np.dtype:
    """A view whose block has these capacities."""
    return record(
        surface=int,  # whose column the direction is orthogonal to, or AXIS_VIEW, or VANE_VIEW
        axis=int,  # reported with an alarm of this view
        direction=5, column=5,  # m and g / |g|: roll, pitch, yaw, side force, normal force
        plane=(int, 2),  # the two components that the column has
        across_gust=int,  # whether m is orthogonal to the rolling gust as well
        has_tolerance=int,  # whether regressors count in this view even if they do in no other block
        inertial=int,  # whether the force is that at the flow angle from inertial motion
        immune_to_vane=int,  # whether an error of a vane does not appear in this view
        confirmed_by=int,  # force of the views that confirm this one; 0 if no vane is used
        # of this frame: whether the view is used; which share of nu along the column leaks into it
        active=int, column_leak=float,
        bounded=1,  # bound on the uncertainty along m, rad/s2
        gust_on_rates=3, gust_on_forces=3,  # effect of the air's rotation about the body axes, 1/s
        peak_score=float,  # largest score, decaying slowly
        block=likelihood.block_dtype(capacity), tones=tones_dtype(capacity.regressors),
    )  # fmt: skip


@kernel
def innovation_component(view, forces, air, inertial_air, innovation, i):
    """Component i of the innovation that a view projects, rad/s2: of the rates (3,), or of a force."""
    if i < SIDE_FORCE:
        gust = 0.0
        if uses_gust_estimate(view, air):
            gust = gust_estimate_for(view, air, inertial_air).output.mean[i]
        return innovation[i] - gust
    force = forces.component[i - SIDE_FORCE]
    return force.inertial if view.inertial else force.innovation


@kernel
def column_component(view, forces, bound, G, j):
    """Entry j, 0 or 1, of the column in a view's plane and the bound on its error, rad/s2 per rad."""
    i, s = view.plane[j], view.surface
    if s == VANE_VIEW:
        size = forces.component[view.plane[1] - SIDE_FORCE].vane[j]
        return size, VANE_TOLERANCE * abs(size)
    if i >= SIDE_FORCE:
        force = forces.component[i - SIDE_FORCE]
        return force.column_predicted[s], force.column_error[s]
    return G[i, s], bound.surface_error_per_rad[i, s] if bound.has_surface_errors else 0.0


@kernel
def set_direction(view, forces, air, bound, G):
    """Fill `direction` and `column` (5,) of a view across a column of G (3, n) rad/s2 per rad.

    Returns the share of the innovation along the column that errors of the column let leak into the view.
    """
    if view.across_gust:
        return set_direction_across_gust(view, forces, air)
    first, second = view.plane[0], view.plane[1]
    first_entry, first_error = column_component(view, forces, bound, G, 0)
    second_entry, second_error = column_component(view, forces, bound, G, 1)
    size = np.sqrt(first_entry * first_entry + second_entry * second_entry)
    if size == 0.0:
        return 0.0
    view.direction[first], view.direction[second] = -second_entry / size, first_entry / size
    view.column[first], view.column[second] = first_entry / size, second_entry / size
    leak = abs(view.direction[first]) * first_error + abs(view.direction[second]) * second_error
    shorter = abs(view.direction[second]) * first_error + abs(view.direction[first]) * second_error
    return leak / max(size - shorter, MIN_COLUMN_LENGTH * size)


@kernel
def set_direction_across_gust(view, forces, air):
    """The same for the direction across two vectors: their vector product in (roll, yaw, side force).

    The vectors are the column of an error of the side vane and the effect of the rolling gust on the rates.
    """
    force = forces.component[0]
    roll, yaw, side = force.vane_roll, force.vane[0], force.vane[1]
    roll_gust, yaw_gust = (
        project_on_axis(air.output.damping[ROLL], air.output.axes, 0),
        project_on_axis(air.output.damping[YAW], air.output.axes, 0),
    )
    by_roll, by_yaw, by_side = -side * yaw_gust, side * roll_gust, roll * yaw_gust - yaw * roll_gust
    length = np.sqrt(by_roll * by_roll + by_yaw * by_yaw + by_side * by_side)
    if length == 0.0:
        return 0.0
    size, leak = np.sqrt(roll * roll + yaw * yaw + side * side), 0.0
    for i, of_vane, by in ((ROLL, roll, by_roll), (YAW, yaw, by_yaw), (SIDE_FORCE, side, by_side)):
        view.direction[i], view.column[i] = by / length, of_vane / size
        leak += VANE_TOLERANCE * abs(view.direction[i] * of_vane)
    return leak / ((1.0 - VANE_TOLERANCE) * size)


@kernel
def uses_gust_estimate(view, air):
    """True if the gust estimate is subtracted from a view: the measured force separates it from faults."""
    return view.confirmed_by > 0 and air.output.uses_accelerometers == 1


@kernel
def uses_force(view):
    """True if a view's direction has a component along a force."""
    return view.direction[SIDE_FORCE] != 0.0 or view.direction[SIDE_FORCE + 1] != 0.0


@kernel
def gust_estimate_for(view, air, inertial_air):
    """The gust estimate that a view uses: from the vanes, or from inertial motion if it must not use them."""
    return inertial_air if view.immune_to_vane else air


@kernel
def fill_gust_sensitivity(view, forces, damping):
    """Fill `gust_on_rates` and `gust_on_forces` (3,), 1/s: the gust sensitivity of a view.

    It is the projected acceleration per rad/s of rotation of the air about each body axis. damping (3, 3)
    1/s: that of the rates.
    """
    m = view.direction
    for k in range(3):
        roll, pitch, yaw = m[ROLL] * damping[ROLL, k], m[PITCH] * damping[PITCH, k], m[YAW] * damping[YAW, k]
        view.gust_on_rates[k] = roll + pitch + yaw
        view.gust_on_forces[k] = 0.0
        for f in range(2):
            view.gust_on_forces[k] += (
                m[SIDE_FORCE + f] * forces.component[f].damping[k] * forces.pressure_ratio
            )


@kernel
def set_view_noise(view, noise, blocks, forces, air, inertial_air, V):
    """Fill measurement noise, jitter, drift intensity and bound of a view from the declared ones; V m/s."""
    block, m = view.block, view.direction
    variance, jitter, bound, drift = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        variance += m[i] * m[i] * blocks[PITCH_BLOCK if i == PITCH else LATERAL].noise[i // 2]
        jitter += abs(m[i]) * np.sqrt(noise.jitter[i])
        if view.immune_to_vane:
            jitter += abs(m[i]) * forces.gust_noise[i]
        bound += abs(m[i]) * (noise.bounded[i] + noise.further_error[i])
    for f, force in enumerate(forces.component):
        jitter += abs(m[SIDE_FORCE + f]) * np.sqrt(force.jitter[view.inertial])
        if view.inertial:
            drift += (m[SIDE_FORCE + f] * forces.pressure_ratio) ** 2 * force.drift_intensity
        bound += abs(m[SIDE_FORCE + f]) * (force.deflection * forces.pressure_ratio + force.lag_error)
    if air.output.moving:
        fill_gust_sensitivity(view, forces, air.output.damping)
        if uses_gust_estimate(view, air):
            drift += remaining_gust_drift(
                gust_estimate_for(view, air, inertial_air), V, view.gust_on_rates, view.gust_on_forces
            )
        else:
            drift += full_gust_drift(air, V, view.gust_on_rates, view.gust_on_forces)
        for i in range(3):
            for j in range(3):
                block.P_dd[0, 0] += m[i] * m[j] * air.output.turn_variance[i, j]
    size = max(bound, likelihood.LEAST_UNCERTAINTY_RAD_S2)
    block.noise[0], block.jitter[0], view.bounded[0] = variance, jitter * jitter, bound
    block.drift[0, 0] = drift + noise.walk_intensity * size * size


@kernel
def fill_view_regressors(view, blocks, forces, air, inertial_air, innovation):
    """Fill the regressors of a view: projections of those of the rates' block, of the force, of the leak.

    innovation (3,) rad/s2.
    """
    block, m = view.block, view.direction
    first, second = view.plane[0], view.plane[1]
    block_of_rates = blocks[PITCH_BLOCK if first == PITCH else LATERAL]
    for j in range(block_of_rates.n_regressors):
        if first == PITCH:
            block.regressor[j, 0] = m[PITCH] * block_of_rates.regressor[j, 0]
        else:
            block.regressor[j, 0] = (
                m[ROLL] * block_of_rates.regressor[j, 0] + m[YAW] * block_of_rates.regressor[j, 1]
            )
    n = block_of_rates.n_regressors
    if second >= SIDE_FORCE and m[second] != 0.0:
        force = forces.component[second - SIDE_FORCE]
        for j in range(force.n):
            block.regressor[n + j, 0] = m[second] * force.regressor[j]
        n += force.n
        if view.inertial:
            block.regressor[n, 0], n = m[second] * force.angle_sensitivity, n + 1
    if view.surface != AXIS_VIEW:
        block.regressor[n, 0] = 0.0
        for i in range(m.size):
            if view.column[i] != 0.0:
                component = innovation_component(view, forces, air, inertial_air, innovation, i)
                block.regressor[n, 0] += view.column_leak * view.column[i] * component


@kernel
def update_directions(views, forces, air, bound, G, Gu):
    """Bring the direction and the signatures of each view to this frame.

    G (3, n) rad/s2 per rad, Gu (3, n) rad/s2: control effectiveness and effect of each surface in the frame.
    """
    for view in views:
        view.active = not uses_force(view) or (forces.known and forces.n_updates == SETTLED_UPDATES)
        if view.active:
            view.column_leak = (
                set_direction(view, forces, air, bound, G) if view.surface != AXIS_VIEW else 0.0
            )
            fill_view_signatures(view, forces, Gu)


@kernel
def project_innovation(views, has_tolerances, noise, blocks, forces, air, inertial_air, innovation, V):
    """Project the innovation (3,) rad/s2 on the direction of each view, into `scratch` of its block.

    Noise follows, and if constant errors are `has_tolerances`, their regressors; V m/s.
    """
    for view in views:
        if not view.active:
            continue
        set_view_noise(view, noise, blocks, forces, air, inertial_air, V)
        m, projected = view.direction, view.block.scratch
        projected[0] = 0.0
        for i in range(m.size):
            if m[i] != 0.0:
                projected[0] += m[i] * innovation_component(view, forces, air, inertial_air, innovation, i)
        if has_tolerances or view.has_tolerance:
            fill_view_regressors(view, blocks, forces, air, inertial_air, innovation)


@kernel
def update_views(views, tests, tone_config, y, dt, k, latched):
    """Update filter and tests of each view with frame k, as `statistical.update_blocks`; y (5,) measured."""
    within_envelope = is_within_envelope(tone_config, y)
    keep, slot = tests.keep if latched else 1.0, likelihood.slot_to_reset(k)
    for view in views:
        if not view.active:
            view.peak_score = 0.0
            continue
        if not latched:
            likelihood.reset_onset(view.block, slot)
        has_tolerances = tests.has_tolerances or view.has_tolerance
        likelihood.update_block(view.block, view.bounded, has_tolerances, dt, keep)
        if not view.inertial:  # the error of the integrated angle oscillates with the aircraft's own modes
            update_tones(view, tone_config, tests.alarm_level, within_envelope, has_tolerances, dt)
        view.peak_score = max((1.0 - (1.0 - tests.keep) / PEAK_MEMORY) * view.peak_score, largest_score(view))


@kernel
def is_sensitive_to(view, forces, s, column):
    """True if a fault of surface s, with this column (3,) of G, changes the projection of a view."""
    if view.surface == s:
        return False
    m, sensitivity = view.direction, 0.0
    for i in range(3):
        sensitivity += m[i] * column[i]
    for f in range(2):
        sensitivity += m[SIDE_FORCE + f] * forces.component[f].column[s]
    return sensitivity != 0.0


@kernel
def largest_score(view):
    """The largest score of the tests of a view."""
    largest = view.tones.score
    for h in range(view.block.n_hypotheses):
        largest = max(largest, view.block.hypothesis[h].score)
    return largest


@kernel
def confirmed_score(view, views, tests, forces, air):
    """The score of a view, limited by the views that confirm that it is not an error of a vane.

    A view of the rates alone needs no confirmation: no error of a vane changes the rates alone. Peak scores
    are compared because the view and its confirmation may reach their levels at different times. The
    confirming view must reach the naming level.
    """
    if uses_force(view) and not forces.known:
        return 0.0
    if view.immune_to_vane or not (uses_force(view) or uses_gust_estimate(view, air)):
        return largest_score(view)
    confirming = 0.0
    for other in views:
        if other.immune_to_vane and other.plane[1] == view.confirmed_by:
            confirming = max(confirming, other.peak_score)
    return min(view.peak_score, confirming * tests.alarm_level / np.sqrt(2.0 * tests.naming_level))


@kernel
def alarm_score(view, views, tests, forces, air):
    """The score with which a view raises the alarm, 0 if it raises none.

    Views raise it only where no block of the rates tests: for an oscillation about an axis, and for a force,
    if accelerometers cannot break.
    """
    if view.surface == AXIS_VIEW and not view.inertial:
        return view.tones.score
    is_mostly_force = view.plane[1] >= SIDE_FORCE and abs(view.direction[view.plane[1]]) > MIN_FORCE_SHARE
    if view.surface >= 0 and is_mostly_force and air.output.uses_accelerometers == 1:
        return confirmed_score(view, views, tests, forces, air)
    return 0.0


@kernel
def excludes_surface(views, tests, forces, air, s, column):
    """True if a view detects a signal that no fault of surface s, with this column (3,) of G, can cause."""
    for view in views:
        tests_surface = not view.immune_to_vane and not is_sensitive_to(view, forces, s, column)
        if tests_surface and confirmed_score(view, views, tests, forces, air) > tests.alarm_level:
            return True
    return False


class Direction(NamedTuple):
    """A parity direction as it is set up.

    column_of: the surface to whose column it is orthogonal, or VANE_VIEW, or AXIS_VIEW; direction: at the
    start; losses: surfaces whose losses are tested; inertial: at the flow angle from inertial motion.
    """

    column_of: int
    direction: tuple[float, ...]
    plane: tuple[int, int]
    losses: list[int]
    inertial: bool = False
    uses_vane: bool = False  # for the gust estimate in moving air, which has no rolling component


def views_of(aircraft: Aircraft, with_force: bool = False) -> Iterator[Direction]:
    """The parity directions of an aircraft: each axis, and in roll and yaw across each surface's column.

    With accelerometers also, in the plane of a rate and its force, across the column of each surface that
    moves both and across that of the vane; and the force at the flow angle from inertial motion.
    """
    in_pitch = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield Direction(AXIS_VIEW, _along((PITCH,)), PITCH_PLANE, in_pitch, uses_vane=True)
    yield Direction(AXIS_VIEW, _along((ROLL,)), LATERAL_PLANE, lateral)
    yield Direction(AXIS_VIEW, _along((YAW,)), LATERAL_PLANE, lateral, uses_vane=True)
    for s in lateral:
        past_roll, others = aircraft.dominant_axis[s] == ROLL, [other for other in lateral if other != s]
        yield Direction(s, _along((ROLL,)), LATERAL_PLANE, others, uses_vane=past_roll)
    if not with_force:
        return
    for f, plane, movers in ((NORMAL, PITCH_PLANE, in_pitch), (SIDE, YAW_PLANE, lateral)):
        found = aircraft.separated_by_force(COMPONENTS[f])
        for s in found:
            own = aircraft.dominant_axis[s], plane[1]
            yield Direction(s, _along(own), own, [other for other in movers if other != s])
        if found:
            yield Direction(VANE_VIEW, _along(plane), plane, movers)
            yield Direction(AXIS_VIEW, _along(plane[1:]), plane, movers, inertial=True)


def _along(components: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(float(i in components) for i in range(NORMAL_FORCE + 1))


def size_for(aircraft: Aircraft) -> RecordSize:
    """The capacities that the records of an aircraft need."""
    axes = [axis_of_term(term) for term in aircraft.moments]
    views = list(views_of(aircraft, aircraft.forces_separate_surfaces))
    rates = N_READINGS + max(axes.count(PITCH), axes.count(ROLL) + axes.count(YAW))
    errors = max(len(force_terms(aircraft, f)) for f in (SIDE, NORMAL)) + forces.MAX_ERRORS - MAX_TERMS_OF_ONE
    turns = [aircraft.dominant_axis[aircraft.surfaces.index(s)] for s in aircraft.class_of_losses]
    losses = max(turns.count(PITCH), turns.count(ROLL) + turns.count(YAW))
    tried = max(len(view.losses) for view in views)
    error_map = aircraft.file.model_error_map
    boxes = len(error_map.boxes) if error_map else 0
    return RecordSize(
        Capacity(rates, 3 * losses + 2), Capacity(rates + errors + 2, tried + 1), len(views), boxes
    )


def configure_views(statistical: np.void, aircraft: Aircraft) -> None:
    """Fill the views of a statistical record whose blocks and forces are already set up."""
    forces = statistical["forces"]
    separated = [aircraft.separated_by_force(COMPONENTS[f]) for f in (SIDE, NORMAL)]
    with_air = forces["known"] and statistical["air"]["output"]["moving"] and all(separated)
    views = list(views_of(aircraft, bool(forces["known"])))[: len(statistical["views"])]
    statistical["n_views"] = len(views)
    for view, (surface, direction, plane, movers, inertial, uses_vane) in zip(
        statistical["views"], views, strict=False
    ):
        view["surface"], view["direction"], view["plane"], block = surface, direction, plane, view["block"]
        view["axis"] = direction.index(1.0) if surface == AXIS_VIEW and not inertial else plane[0]
        axes = statistical["block"][PITCH_BLOCK if plane == PITCH_PLANE else LATERAL]
        # A law that uses the vanes reacts to a gust before the gyros measure its pitching effect, and these
        # views do not use the vanes. The elevator's effect then correlates with the noise: no loss is tested.
        answered = statistical["air"]["output"]["moving"] and direction[PITCH]
        tried = [] if answered else movers[: len(block["hypothesis"]) - 1]
        kinds, n = [STEP, *(LOSS for _ in tried)], int(axes["n_regressors"])
        block["n"], block["n_hypotheses"], block["keep"] = 1, len(kinds), 1.0
        block["P_xx"][0, 0], block["P_dd"][0, 0] = axes["noise"].max(), likelihood.PRIOR_DRIFT_RAD_S2**2
        for name in ("level", "noise_share", "pace"):
            block[name] = axes[name]
        block["tolerance"][:n] = axes["tolerance"][:n]
        if uses_vane and with_air:
            view["confirmed_by"] = NORMAL_FORCE if plane == PITCH_PLANE else SIDE_FORCE
        if any(direction[SIDE_FORCE:]):
            force, view["confirmed_by"] = forces["component"][plane[1] - SIDE_FORCE], plane[1]
            view["has_tolerance"], of_force = 1, int(force["n"])
            block["tolerance"][n : n + of_force] = force["tolerance"][:of_force]
            n += of_force
            if inertial:
                block["tolerance"][n], n = force["drift"], n + 1
        block["n_regressors"] = n + (surface != AXIS_VIEW)
        block["tolerance"][n] = float(surface != AXIS_VIEW)  # of the leak, which is worked out in flight
        hypotheses = block["hypothesis"][: len(kinds)]
        hypotheses["kind"], hypotheses["surface"] = kinds, [-1, *tried]
        view["across_gust"] = (
            surface == VANE_VIEW and plane == YAW_PLANE and statistical["air"]["output"]["moving"]
        )
        view["inertial"], view["immune_to_vane"] = inertial, inertial or surface == VANE_VIEW
        likelihood.set_supporting_signs(block, kinds)


@kernel
def fill_block_signatures(blocks, Gu, cubic):
    """Fill the signatures of the blocks of the rates, rad/s2.

    Gu (3, n) rad/s2: effect of each surface, mean over the frame; cubic rad/s2: pitch acceleration of a
    coefficient 1 of alpha^3.
    """
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            for i in range(block.n):
                if hypothesis.surface >= 0:
                    hypothesis.signature[i] = Gu[block.axis[i], hypothesis.surface]
                elif hypothesis.kind == STEP:
                    hypothesis.signature[i] = 1.0 if hypothesis.axis == block.axis[i] else 0.0
                else:
                    hypothesis.signature[i] = cubic


@kernel
def fill_view_signatures(view, forces, Gu):
    """Fill the projections of the signatures on the direction of a view: of a step, and of losses.

    Gu (3, n) rad/s2: effect of each surface, mean over the frame.
    """
    block, m = view.block, view.direction
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        s = hypothesis.surface
        hypothesis.signature[0] = 1.0
        if hypothesis.kind != STEP:
            moment = m[0] * Gu[0, s] + m[1] * Gu[1, s] + m[2] * Gu[2, s]
            for f in range(2):
                moment += m[SIDE_FORCE + f] * forces.component[f].effect[s]
            hypothesis.signature[0] = moment
