"""Two faults at once, a plane by itself: pitch; roll and yaw. Page: fault-types.md (two faults at once).

In roll and yaw both deviations follow from both equations. In pitch a constant fault that explains everything
on one surface is taken for the only one, until it does not; a second one then begins on the other surface.
"""

from typing import Any

import numpy as np

from reference.isolation import Effect, Frame
from reference.naming import PITCH, UNANTICIPATED, Finding, Naming, Part, only
from reference.types import Loss, Type

ROLL, YAW = 0, 2
HELD = ("stuck", "hardover")


class Pairs(Naming):
    """The verdict of one flight. alarms: of pitch, of roll and yaw; outside: no deviations of aileron and
    rudder explain a frame; first, stored: first fault in pitch, and the sets of its types."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        leading = self.declaration.aircraft.leaders
        leaders = {part.axis: part for part in self.surfaces if part.name in leading}
        self.lateral = [leaders[ROLL], leaders[YAW]]
        for part in self.surfaces:
            part.sole = part in self.pitch
        self.alarms, self.outside = [False, False], False
        self.first: Part | None = None
        self.stored: list[tuple[float, float, bool]] = []
        self.unstored = 0

    @property
    def second(self) -> Part | None:
        """The surface of a second fault in pitch, once it has begun."""
        if self.first is None or self.first.sole:
            return None
        return next(part for part in self.pitch if part is not self.first)

    def take(self, frame: Frame, of: Effect, observed: bool) -> str | None:
        beyond = (np.abs(self.bank.E[frame.k]) > self.bank.T[frame.k]).any(axis=0)
        self.alarms = [self.alarms[0] or beyond[PITCH], self.alarms[1] or beyond[ROLL] or beyond[YAW]]
        return super().take(frame, of, True)

    def locate(self, frame: Frame, of: Effect) -> None:
        """Roll and yaw, by Cramer's rule: nu = G_1 (delta_1 - u_1) + G_2 (delta_2 - u_2) + eta.

            delta_1 - u_1 = (nu_p N_2 - nu_r L_2) / det +- (e_p |N_2| + e_r |L_2|) / |det|

        L, N: roll and yaw acceleration of one rad; det = L_1 N_2 - N_1 L_2; e: bound and both tolerances. In
        pitch, with the first fault within [lo, hi] by its stored sets:

            delta_2 - u_2 = (nu - M_1 (delta_1 - u_1)) / M_2 +- (|M_1| (hi - lo) / 2 + e) / |M_2|
        """
        nu, bound = frame.nu, frame.bound
        for one, other in (self.lateral, self.lateral[::-1]):
            (L1, _, N1), (L2, _, N2) = of.Z[one.row], of.Z[other.row]
            det, e = L1 * N2 - N1 * L2, bound + of.r[one.row] + of.r[other.row]
            off = (e[ROLL] * abs(N2) + e[YAW] * abs(L2)) / abs(det)
            if not one.see_offset((nu[ROLL] * N2 - nu[YAW] * L2) / det, off):
                self.outside = True
        if (second := self.second) is None:
            for part in self.pitch:
                part.seen[-1] = part.seen[-1]._replace(shows=bool(abs(nu[PITCH]) > bound[PITCH]))
            return
        first = self.first
        ends = [one.places(len(first.seen) - 1) for one in first.constant]
        lo, hi = min(end[0] for end in ends), max(end[1] for end in ends)
        lo, hi = (min(max(end, first.reach[0]), first.reach[1]) for end in (lo, hi))
        first.seen[-1] = first.seen[-1]._replace(lo=lo, hi=hi, shows=False)
        M1, M2 = of.Z[first.row, PITCH], of.Z[second.row, PITCH]
        e = bound[PITCH] + of.r[first.row, PITCH] + of.r[second.row, PITCH]
        left = nu[PITCH] - M1 * 0.5 * sum(first.offset(-1))
        if not second.see_offset(left / M2, (0.5 * abs(M1) * (hi - lo) + e) / abs(M2)):
            second.at_fault = False

    def decide(self, k: int) -> str | None:
        """The surface that was named first."""
        outside = self.decide_lateral(k)
        self.decide_pitch(k)
        named = [part for part in self.surfaces if part.named is not None]
        if named:
            return min(named, key=lambda part: part.named).name
        return UNANTICIPATED if outside else None

    def decide_lateral(self, k: int) -> bool:
        """A surface is named if the other one alone cannot be at fault; whether both together are refuted."""
        one, other = self.lateral
        both = not self.possible(one) and not self.possible(other)
        refuted = self.outside or not (one.left and other.left)
        shown = one.explains and other.explains
        judged = self.alarms[1] and not (both and (refuted or not shown))
        for part, beside in ((one, other), (other, one)):
            part.conclude(judged and not self.possible(beside), part.type_of_fault(), k)
        return both and refuted

    def decide_pitch(self, k: int) -> None:
        """The only surface by a constant type; or both, once a second fault has begun."""
        first = self.first
        if first and not self.second and not (self.possible(first) and first.constant):
            self.begin_second(first)
        if second := self.second:
            possible = self.possible(second) and bool(second.left)
            first.conclude(possible or not second.count, first.kind, k)
            shows = bool(second.count) and possible and second.explains
            second.conclude(shows, second.type_of_fault(), k)
            return
        found = self.find() if self.alarms[0] else None
        found = found if isinstance(found, Part) and found.constant else None
        if found:
            imitated = found.can_be_another(only(found.constant), False)
            if found.count >= self.rules.half and found.waited and not imitated:
                self.store(found)
        for part in self.pitch:
            kind = part.type_of_fault() if part is found else None
            # a jam may as well be a float or a hardover, if the other surface is off by a constant
            part.conclude(part is found, None if kind and kind.name in HELD else kind, k)

    def store(self, part: Part) -> None:
        """Store the sets of the first fault; again once types have been excluded for half a period."""
        now = [(one.low, one.high, one.excluded or not one.constant) for one in part.types]
        changed = any(
            new[2] != old[2]
            for new, old in zip(now, self.stored or [(0.0, 0.0, False)] * len(now), strict=True)
        )
        self.unstored = self.unstored + 1 if changed else 0
        if self.first is not part or self.unstored >= self.rules.half:
            self.first, self.stored, self.unstored = part, now, 0

    def begin_second(self, first: Part) -> None:
        """The first fault gets its stored sets back; of the other surface nothing is known."""
        for one, (low, high, excluded) in zip(first.types, self.stored, strict=True):
            one.low, one.high, one.excluded = low, high, excluded
        other = next(part for part in self.pitch if part is not first)
        other.begin()
        other.seen[-1] = other.seen[-1]._replace(lo=other.reach[0], hi=other.reach[1])
        for part in self.pitch:
            part.sole, part.at_fault = False, True
            part.seen[-3:] = [seen._replace(shows=False) for seen in part.seen[-3:]]

    def types_of(self, part: Part) -> list[str]:
        """With a constant type that holds the surface in pitch, all constant types are possible: the other
        surface may be off, too."""
        names = super().types_of(part)
        held: list[Type] = part.constant if self.possible(part) or part.named is not None else []
        if part in self.pitch and any(one.name in HELD for one in held):
            fixed = [one.name for one in part.types if one.constant]
            names += sorted(fixed, key=lambda name: name == Loss.name)
        return [*dict.fromkeys(names)]

    def texts_of(self, parts: list[Part]) -> list[str]:
        first = self.first
        if first in parts and not (first.sole or first.named is not None):
            return [UNANTICIPATED]
        found = super().texts_of(parts)
        last = [found.pop()] if found[-1] == UNANTICIPATED else []
        return [*found, "+".join(part.name for part in parts), *last]

    def open_planes(self) -> list[list[str]]:
        """Candidates of each plane with an alarm and no name."""
        lateral = [part for part in self.surfaces if part not in self.pitch]
        planes = [*zip(self.alarms, (self.pitch, lateral), strict=True)]
        return [
            self.texts_of(parts)
            for alarm, parts in planes
            if alarm and all(part.named is None for part in parts)
        ]

    def findings(self, name: str | None) -> list[Finding]:
        """The named surfaces, then the open planes."""
        return [*self.of_named(), *(Finding(None, None, None, texts) for texts in self.open_planes())]
