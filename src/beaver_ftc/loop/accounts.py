"""The accounts of a flight, which the metrics are made of. They alone, and the oracle, see the truth.

One of them is the instant from which detection is certain, whatever the uncertainty does: if

    |int e^{-lam (t - tau)} phi_i dtau| > 2 ebar_i

for some axis i, the fault has been detected by t [Zhang2002]: at worst an admissible eta hides ebar_i of the
fault's effect phi, rad/s2. lam 1/s: pole of a filter, ebar_i rad/s: its threshold. With a bank of filters,
the first of their instants. phi is the truth's, so this is an analyst's figure: the diagnosis never sees it.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.control.accommodation import MAX_EVENTS
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.diagnosis.detection.filters import filter_share
from beaver_ftc.diagnosis.error_map import N_MAP_COORDINATES, map_row, outside_span
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import detection_share
from beaver_ftc.diagnosis.state import PITCH, PLUGIN_SCHEME
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import effective, position
from beaver_ftc.scenario.diagnosis import MAX_POLES

GUARANTEE = record(
    phi=3, phi_sum=3,  # effect of the faults, rad/s2: now, and over the frame
    effect=(MAX_POLES, 3),  # filtered as the bank filters the innovation, rad/s
    certain_after_s=float,
)  # fmt: skip
TRACKING = record(
    before=3, frames_before=int,  # squared error before a fault, rad2/s2, and since
    since=3, frames_since=int,
)  # fmt: skip
AUTHORITY = record(demanded=3, lacking=3, beyond_frames=(int, 3))
# Largest shares of an alarm in healthy flight: |eps| / mu of each filter, and the score of the statistics.
CLOSEST = record(filter=MAX_POLES, score=float)
ENVELOPE = record(
    outside=int, n_exits=int, outside_frames=int, exit_at_s=MAX_EVENTS, return_at_s=MAX_EVENTS,
)  # fmt: skip
# Frames in which the diagnosis concludes nothing, of so many watched. undiagnosed: there is none. late: the
# flight is older than any that was measured. beyond: outside the map of the model's error in this quantity,
# which was then between least and greatest. between: inside the range of each quantity, but in no box.
INCONCLUSIVE = record(
    watched=int, frames=int, from_s=float, undiagnosed=int, late=int, between=int,
    beyond=(int, N_MAP_COORDINATES), least=N_MAP_COORDINATES, greatest=N_MAP_COORDINATES,
)  # fmt: skip


@sized
def accounts_dtype(n: int) -> np.dtype:
    """Accounts of a flight with n surfaces; actuator_travel (n,) rad, actuator_energy
    (n,) rad2/s: the integral of the speed's square. beyond_threshold_at_s: since a window of faults began
    (windows.py), the first frame in which the diagnosis shows a fault, -1 if none."""
    return record(
        guarantee=GUARANTEE, tracking=TRACKING, authority=AUTHORITY, closest=CLOSEST,
        envelope=ENVELOPE, inconclusive=INCONCLUSIVE, beyond_threshold_at_s=float,
        saturated_frames=(int, n), actuator_travel=n, actuator_energy=n, position_then=n,
    )  # fmt: skip


@kernel
def effect_of_faults(guarantee, truth, prediction, y):
    """Fill guarantee.phi (3,) rad/s2: what the truth's faults do to the angular acceleration, as the design
    model weighs it."""
    phi, G, u = guarantee.phi, prediction.G, prediction.u
    phi[:] = 0.0
    if truth.faulted:
        for i in range(3):
            for s in range(u.size):
                phi[i] += G[i, s] * (effective(truth, s) - u[s])
        phi[PITCH] += unanticipated_pitch(prediction.design, y, truth.Cm_alpha3)


@kernel
def add_effect(guarantee):
    """Add the effect of an instant inside a frame to the sum over the frame."""
    for i in range(3):
        guarantee.phi_sum[i] += guarantee.phi[i]


@kernel
def follow_guarantee(guarantee, bank, dt, share, k, t):
    """Advance the filtered effect by the elapsed frame and note the first instant t (s) of certainty.

    share: one over the instants in a frame. The sum then restarts with this instant. k: number of the
    diagnosis' frame; with its first one, of 0, its filters are empty, whatever went before.
    """
    if k == 0:
        guarantee.effect[:], guarantee.certain_after_s = 0.0, -1.0
        guarantee.phi_sum = guarantee.phi
        return
    for i in range(3):
        mean = share * guarantee.phi_sum[i]
        for m in range(bank.config.n_filters):
            effect = bank.config.a[m] * guarantee.effect[m, i] + dt * mean
            guarantee.effect[m, i] = effect
            certain = abs(effect) > 2.0 * bank.output.threshold[m, i] > 0.0
            if certain and guarantee.certain_after_s < 0.0:
                guarantee.certain_after_s = t
        guarantee.phi_sum[i] = guarantee.phi[i]


@kernel
def track(tracking, truth, model_rate):
    """Add this frame's squared error of the rates, rad2/s2; model_rate (3,) rad/s."""
    if truth.faulted:
        sums = tracking.since
        tracking.frames_since += 1
    else:
        sums = tracking.before
        tracking.frames_before += 1
    for i in range(3):
        sums[i] += (model_rate[i] - truth.value[i]) ** 2


@kernel
def account_surfaces(accounts, truth, saturated, k, dt):
    """How long each surface was saturated, how far it has travelled and how fast."""
    for s in range(saturated.size):
        now = position(truth, s)
        accounts.saturated_frames[s] += saturated[s]
        if k > 0:
            moved = now - accounts.position_then[s]
            accounts.actuator_travel[s] += abs(moved)
            accounts.actuator_energy[s] += moved * moved / dt
        accounts.position_then[s] = now


@kernel
def account_authority(authority, axes):
    """How much of what was demanded after the fault the surfaces could not give, and for how long not even
    the rates could have been held."""
    for i in range(3):
        authority.demanded[i] += abs(axes.demand[i])
        authority.lacking[i] += abs(axes.shortfall[i])
        authority.beyond_frames[i] += axes.beyond[i]


@kernel
def note_envelope(envelope, outside, t):
    """Note when the flight leaves the validated envelope and when it comes back; t s."""
    envelope.outside_frames += outside
    exits = outside and not envelope.outside
    envelope.n_exits += exits
    last = min(envelope.n_exits, MAX_EVENTS) - 1  # of more than there is room for, the latest stays
    if exits:
        envelope.exit_at_s[last], envelope.return_at_s[last] = t, np.inf
    elif envelope.outside and not outside:
        envelope.return_at_s[last] = t
    envelope.outside = outside


@kernel
def note_inconclusive(inconclusive, fdi, t):
    """Count this frame, and why nothing can be concluded in it; t s."""
    enabled, error_map = fdi.config.enabled, fdi.bound.error_map
    inconclusive.watched += 1
    if enabled and (error_map.n_boxes == 0 or not error_map.outside):
        return
    if inconclusive.frames == 0:
        inconclusive.from_s = t
    inconclusive.frames += 1
    if not enabled:
        inconclusive.undiagnosed += 1
    elif map_row(error_map) < 0:
        inconclusive.late += 1
    else:
        note_place(inconclusive, error_map)


@kernel
def note_place(inconclusive, error_map):
    """Count the quantities in which this place is outside the map."""
    explained = False
    for i in range(error_map.coordinates.size):
        if outside_span(error_map, i):
            now, first = error_map.coordinates[i], inconclusive.beyond[i] == 0
            inconclusive.least[i] = now if first else min(now, inconclusive.least[i])
            inconclusive.greatest[i] = now if first else max(now, inconclusive.greatest[i])
            inconclusive.beyond[i] += 1
            explained = True
    inconclusive.between += not explained


@kernel
def note_beyond_threshold(accounts, fdi, t):
    """Note that a detector is beyond its threshold at t s. A plug-in says so itself."""
    monitor = fdi.sensor_monitor
    if fdi.config.scheme_number == PLUGIN_SCHEME:
        is_beyond = fdi.plugin_verdict.detected == 1
    else:
        by_monitor = sensor_monitor.has_alarm(monitor) and monitor.output.top_ratio > 1.0
        is_beyond = by_monitor or detection_share(fdi) > 1.0
    if is_beyond:
        accounts.beyond_threshold_at_s = t


@kernel
def keep_closest(closest, bank, alarm):
    """Keep the largest share of its threshold that each filter has reached, and that of the detector."""
    closest.score = max(closest.score, alarm.ratio)
    for m in range(bank.config.n_filters):
        for i in range(3):
            closest.filter[m] = max(closest.filter[m], filter_share(bank, m, i))


@kernel
def account(frame):
    """Advance the metrics' sums by this frame; before a fault, the closest approach to an alarm."""
    control, truth, sums = frame.control, frame.truth, frame.accounts
    track(sums.tracking, truth, control.reference.output.model_rate)
    if truth.faulted:
        account_authority(sums.authority, control.axes)
        if sums.beyond_threshold_at_s < 0.0:
            note_beyond_threshold(sums, frame.fdi, frame.t)
    else:
        keep_closest(sums.closest, frame.fdi.bank, frame.fdi.statistical.alarm)
    saturated, dt = control.allocation.output.saturated, control.reference.config.dt
    account_surfaces(sums, truth, saturated, frame.k, dt)
    note_envelope(sums.envelope, truth.value[ch.ENVELOPE] < 0.5, frame.t)
    note_inconclusive(sums.inconclusive, frame.fdi, frame.t)
