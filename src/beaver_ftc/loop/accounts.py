"""The accounts of a flight, which the metrics are made of. They alone, and the oracle, see the truth.

Two of them have files of their own: the instant from which detection is certain (guarantee.py), and the
frames in which nothing can be concluded (inconclusive.py).
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.control.accommodation import MAX_EVENTS
from beaver_ftc.diagnosis.config import PLUGIN_SCHEME
from beaver_ftc.diagnosis.detection.filters import filter_share
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import detection_share
from beaver_ftc.loop.guarantee import GUARANTEE
from beaver_ftc.loop.inconclusive import INCONCLUSIVE, note_inconclusive
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import position
from beaver_ftc.scenario.diagnosis import MAX_POLES

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
