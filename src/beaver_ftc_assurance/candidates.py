"""The *candidates*, i.e. faults that are not excluded at the end of a flight, and the deflections that are
certain to distinguish two of them.

If the parameter of a fault is constant, the data since the alarm give an interval for it. At a command u, the
deflection of its surface is then in an interval, too: stuck [c-, c+], floating 0 or the stop nearest to 0, a
loss [e- u, e+ u], a bias u + [b-, b+], rad. B (3,), rad/s2, is the bound on the innovation of a frame at the
largest rates that the doublet may reach; G (3, n), rad/s2 per rad, the effectiveness of the surfaces; M a
margin.

Two types on one surface s are distinguished by a frame in which, on some axis i, their deflections differ by
more than 2 M B_i / |G_is|, twice the difference that the uncertainty can hide. They must differ from the
command by as much, because a frame that health explains does not exclude a fault that may end.

Two surfaces a and b are distinguished along a direction d with d.G_b = 0, in which b has no effect, by a
frame in which a differs from its command by more than 2 M |d|.B / |d.G_a|.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees, inf

import numpy as np

from beaver_ftc.diagnosis import TYPE_NAMES, UNANTICIPATED, DiagnosisReadout
from beaver_ftc.diagnosis import TYPE_ROWS as TYPES
from beaver_ftc.results import Document
from beaver_ftc.scenario import Scenario
from beaver_ftc_assurance.certificates.history import History, declared_errors_of
from beaver_ftc_assurance.certificates.inequality import Hypothesis
from beaver_ftc_assurance.certificates.kinds import hypothesis_of_type, travel_rad
from beaver_ftc_assurance.certificates.search import theta_bounds_by_frame
from beaver_ftc_assurance.certificates.tape import Tape
from beaver_ftc_assurance.doublet import LONGEST_S, Situation, doublet

MARGIN = 1.1  # M: G and B are those of the last frame, and change while the doublet is flown
GRID = 801  # number of deflections that are tried over the travel
# Type with a constant parameter and a relation -> the relation.
RELATIONS = {
    kind: row.deflection_relation
    for kind, row in enumerate(TYPES)
    if row.has_constant_parameter and row.deflection_relation
}
LOSS = TYPE_NAMES.index("loss_of_effectiveness")  # the only type of the fault class `losses`


@dataclass(frozen=True)
class Candidate:
    """A fault type, one of RELATIONS, on a surface; its parameter is between low and high."""

    surface: int
    kind: int
    low: float
    high: float

    def deflection(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest deflection, rad, of the surface at commands u (n,) rad, by the relation of its
        type: (gain + theta) u if theta is a share, otherwise gain u + theta."""
        gain, is_share, _ = RELATIONS[self.kind]
        ends = [(gain + end) * u if is_share else gain * u + end for end in (self.low, self.high)]
        return np.minimum(*ends), np.maximum(*ends)

    def off(self, u: np.ndarray) -> np.ndarray:
        """Least distance of the surface from its commands u, (n,) rad."""
        low, high = self.deflection(u)
        return np.asarray(np.maximum(0.0, np.maximum(low - u, u - high)))


def situation_of(tape: Tape, scenario: Scenario, rate: float) -> Situation:
    """The aircraft at the end of a flight; rate: largest allowed body rate, rad/s. Its bound is that of the
    last frame, plus the largest error of the inertia coupling at this rate, plus the noise of the gyros at
    both ends of a frame."""
    frame = tape.last
    aircraft = scenario.airframe
    dt = 1.0 / scenario.rate_hz
    bound = frame.diagnosis.declared_bounds
    actuators = frame.actuators
    coupled = declared_errors_of(frame).c * rate**2
    return Situation(
        G=frame.mean_G, u=frame.expected_u_rad, x=frame.rates_rad_s, rate=rate,
        bound=bound.eta_bar_rad_s2 + coupled + 2.0 * bound.gyro_change_rad_s / dt,
        stops=np.array([actuators.low_rad, actuators.high_rad]), approach=actuators.approach,
        step=actuators.step_rad, instants=scenario.substeps,
        in_blocks=frame.diagnosis.types_config.frames_per_block > 1, dt=dt,
        alpha=frame.alpha_rad, alpha_range=aircraft.alpha_rad,
    )  # fmt: skip


def candidates(history: History) -> Iterator[Candidate]:
    """Every fault of RELATIONS that is not excluded, with the interval of its parameter; left out if the
    interval is empty. None at all if the diagnosis reports a fault of no known type, or if health explains
    all frames since the alarm. The other frames alone give the interval: in a frame that health explains, the
    fault may be absent."""
    tape = history.tape
    last = tape.last.diagnosis
    frames = np.arange(round(last.detected_at_s / tape.last.dt_s), tape.end)  # from the alarm on
    shown = frames[history.is_unexplained(frames)]
    if last.isolated_estimator == UNANTICIPATED or not len(shown):
        return
    for s, kind in faults_left(last):
        if kind not in RELATIONS:
            continue
        low, high = RELATIONS[kind].theta_span(*travel_rad(tape, s))
        if low < high:
            low, high = _interval(hypothesis_of_type(history, s, kind), shown)
        if low <= high:
            yield Candidate(s, kind, low, high)


def faults_left(diagnosis: DiagnosisReadout) -> Iterator[tuple[int, int]]:
    """Surface and type of each fault that is not excluded. The fault class `losses` has one type."""
    estimators = diagnosis.estimators
    layout = diagnosis.layout
    for s, surface in enumerate(diagnosis.surface_fault_types):
        if not diagnosis.diagnoses_all_types:
            e = layout.loss_estimator[s]
            if e >= 0 and not estimators[e].is_excluded:
                yield s, LOSS
        elif not estimators[layout.position_estimator[s]].is_excluded:
            yield from ((s, kind) for kind in np.flatnonzero(~surface.is_type_excluded).tolist())


def _interval(hypothesis: Hypothesis, frames: np.ndarray) -> tuple[float, float]:
    """The interval of a parameter that is constant in these frames: the intersection of those of frames and
    axes."""
    lower, upper, _ = theta_bounds_by_frame(hypothesis, frames)
    return max(hypothesis.theta_low, float(lower.max())), min(hypothesis.theta_high, float(upper.min()))


def distinguish(fault_a: Candidate, fault_b: Candidate, at: Situation, names: Sequence[str]) -> Document:
    """A doublet that is certain to distinguish two candidates, or the reason why there is none.

    targets: surface -> deflection that it must reach. Of two surfaces, each must show its own fault.
    """
    targets: dict[int, float] = {}
    needs: Document = {}
    orders = [(fault_a, fault_b), (fault_b, fault_a)]
    if fault_a.surface == fault_b.surface:
        del orders[1]
        if at.in_blocks:
            return _none("with noisy gyros, blocks of frames distinguish types, not single frames", needs)
    for fault, other in orders:
        target, needs[names[fault.surface]] = _target(fault, other, at)
        if target is None:
            return _none(needs[names[fault.surface]]["because"], needs)
        targets[fault.surface] = target
    solution = doublet(targets, at)
    if solution is None:
        text = f"no doublet within {LONGEST_S:g} s keeps the rates below {degrees(at.rate):g} deg/s"
        return _none(f"{text} and the angle of attack in its range", needs)
    commands, frames = solution
    return {
        "separates": True,
        # A command is in effect one frame later, and a frame is judged together with the next one.
        "time_s": (frames + 2) * at.dt,
        "duration_s": len(commands) * at.dt,
        "amplitude_deg": degrees(max(abs(commands[:, [*targets]] - at.u[[*targets]]).max(axis=0))),
        "needs": needs,
        "commands_rad": {names[s]: commands[:, s].tolist() for s in targets},
    }


def _none(because: str, needs: Document) -> Document:
    """The document of two candidates without a doublet. needs: numbers for each surface, as far as known."""
    return {"separates": False, "because": because, "needs": needs}


def _target(fault: Candidate, other: Candidate, at: Situation) -> tuple[float | None, Document]:
    """The deflection nearest to the present one with difference > room, None if there is none; and the
    numbers that decide it, with the reason if there is none. On one surface s, difference, rad, is the least
    distance between the positions by the two types and the command; otherwise it is the distance of surface s
    of `fault` from its command, which must show where the surface of `other` has no effect.

        room = least over the directions d of 2 M |d|.B / |d.G_s|

    d: the axes on which s has an effect, or the directions of `_blind_to`. room is infinite without one.
    """
    s = fault.surface
    G_s = at.G[:, s]
    # over the whole travel, and the present one
    u = np.append(np.linspace(at.stops[0, s], at.stops[1, s], GRID), np.clip(at.u[s], *at.stops[:, s]))
    difference = fault.off(u)  # health must not explain the frame
    directions = _blind_to(other.surface, at, s)
    too_small = (
        "the surface must differ from its command by more than {:.3g} deg; within the travel, it differs by "
        "{:.3g} deg at most"
    )
    if other.surface == s:
        low, high = fault.deflection(u)
        low_b, high_b = other.deflection(u)
        gap = np.maximum(low - high_b, low_b - high)
        difference = np.minimum(gap, np.minimum(difference, other.off(u)))
        directions = (d for d in np.eye(3) if d @ G_s)
        too_small = (
            "the positions must differ from each other and from the command by more than {:.3g} deg; within "
            "the travel, they differ by {:.3g} deg at most"
        )
    room = min((2.0 * MARGIN * np.abs(d) @ at.bound / abs(d @ G_s) for d in directions), default=inf)
    is_known = room < inf
    numbers = {
        "at_least_deg": degrees(room) if is_known else None, "at_most_deg": degrees(difference.max()),
        "now_deg": degrees(at.u[s]),
    }  # fmt: skip
    allowed = u[difference > room]
    if not allowed.size:
        text = too_small.format(degrees(room), numbers["at_most_deg"])
        return None, numbers | {"because": text if is_known else "no direction shows the fault"}
    target = float(allowed[np.argmin(np.abs(allowed - at.u[s]))])
    return target, numbers | {"target_deg": degrees(target)}


def _blind_to(b: int, at: Situation, a: int) -> Iterator[np.ndarray]:
    """Directions d (3,) with d.G_b = 0, in which surface a has an effect: for each two axes the direction
    perpendicular to G_b, and each axis on which b has no effect."""
    G_b = at.G[:, b]
    for d in (*np.cross(np.eye(3), G_b), *np.eye(3)[G_b == 0.0]):
        if abs(d @ at.G[:, a]) > 1e-9 * np.abs(d).max():
            yield d
