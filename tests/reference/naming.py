"""From the types that are left to surface, type and candidates. Page: fault-types.md.

A verdict on a surface assumes that it is at fault; `Naming.possible` says whether it can be.
"""

from typing import NamedTuple

import numpy as np

from reference.bounds import Bounds
from reference.declaration import POSITION, Declaration
from reference.detection import Bank
from reference.isolation import Effect, Frame, Isolation
from reference.types import (
    Rules,
    Seen,
    Surface,
    Type,
    meet,
)

UNANTICIPATED, PITCH = "unanticipated", 1
DECLARED = ("sensors", "actuators", "coefficients", "inertia", "deflection_deg", "turbulence")
Withdrawn = tuple[str, str | None, int, int]  # surface, type, first and last frame


class Finding(NamedTuple):
    """A fault at the end of a flight: its name and type, the frame of the name, the candidates."""

    name: str | None
    kind: str | None
    since: int | None
    candidates: list[str]


class Part(Surface):
    """A surface, and what is concluded of it. sole: whether it may be the only one at fault; at_fault: what
    follows from the other surface of its plane, None: its position decides; named: since which frame."""

    axis, row, sole = 0, 0, True
    at_fault: bool | None = None
    named: int | None = None
    since = 0
    kind: Type | None = None

    @property
    def left(self) -> list[Type]:
        """Types that are not excluded."""
        return [one for one in self.types if not one.excluded]

    @property
    def constant(self) -> list[Type]:
        """Those with a constant parameter."""
        return [one for one in self.left if one.constant]

    @property
    def explains(self) -> bool:
        """Whether some type explains the flight."""
        return any(one.shown for one in self.left)

    @property
    def waited(self) -> bool:
        """Whether each type that must show itself would have done so."""
        return all(self.unhidden >= one.must_show * self.rules.half for one in self.left)

    def see_offset(self, e: float, tolerance: float) -> bool:
        """The last frame says delta - u = e +- tolerance; whether that is possible."""
        seen = self.seen[-1]
        lo, hi = meet(self.reach, (seen.u + e - tolerance, seen.u + e + tolerance))
        self.seen[-1] = seen._replace(
            lo=lo, hi=hi, shows=abs(e) > tolerance, hidden=self.hides(seen.u_min, seen.u_max, 2.0 * tolerance)
        )
        return lo <= hi

    def hides(self, u_min: float, u_max: float, width: float) -> tuple[bool, bool]:
        """Whether each stop is nearer to u than the width of the interval of positions."""
        return u_min - self.stops[0] < width, self.stops[1] - u_max < width

    def can_be_another(self, apparent: Type | None, follows: bool) -> bool:
        """Whether what looks like this constant type may be a varying one; follows: of any kind."""
        return any(
            one.name == apparent.name and one.name in other.like and not other.rules_out(one)
            for other in self.left
            for one in self.constant
            if apparent and not other.constant and (follows or not other.follows)
        )

    def type_of_fault(self) -> Type | None:
        """The type, None while more than one fits or one may yet show itself."""
        if self.count < self.rules.half:
            return None
        if self.rules.coarse:
            one = only(self.left)
            return one if one and one.shown else None
        if self.constant:
            one = only(self.constant)
            return one if self.waited and not self.can_be_another(one, True) else None
        quiet = [one for one in self.left if not one.must_show]
        if not quiet:
            one = only(self.left)
            return one if one and one.shown else None
        one = only(quiet)
        other = one and any(one.name in each.like for each in self.left)
        return None if other or not self.waited else one

    def conclude(self, named: bool, kind: Type | None, k: int) -> None:
        """Name it, or not."""
        kind = kind if named else None
        old, new = self.kind and self.kind.name, kind and kind.name
        if self.named is not None and not named:
            self.withdrawn.append((self.name, old, self.named, k))
        elif old and new != old:
            self.retyped.append((self.name, old, self.since, k))
        if named != (self.named is not None):
            self.named = k if named else None
        self.kind, self.since = kind, k if new != old else self.since


def only(types: list[Type]) -> Type | None:
    """The first type, if all have one name."""
    return types[0] if len({one.name for one in types}) == 1 else None


class Naming:
    """The verdict of one flight on faults of all types, frame by frame, from the alarm on.

    G, u, command: at every instant.
    """

    def __init__(
        self, declaration: Declaration, isolation: Isolation, bank: Bank, bounds: Bounds, G: np.ndarray,
        command: np.ndarray,
    ) -> None:  # fmt: skip
        coarse = any(declaration[f"bounds.{name}"] not in ("ideal", "none", 0.0, {}) for name in DECLARED)
        self.declaration, self.isolation, self.bank = declaration, isolation, bank
        self.rules, self.G, self.u, self.command = Rules(declaration, coarse), G, bounds.u, command
        self.surfaces: list[Part] = []
        aircraft = declaration.aircraft
        for row, one in enumerate(isolation.of):
            if one.kind == POSITION:
                part = Part(declaration, self.rules, one)
                part.axis, part.row = int(aircraft.main_axis[one.surface]), row
                self.surfaces.append(part)
        self.pitch = [part for part in self.surfaces if part.axis == PITCH]
        self.withdrawn: list[Withdrawn] = []  # names, and types of names that stayed
        self.retyped: list[Withdrawn] = []
        for part in self.surfaces:
            part.withdrawn, part.retyped = self.withdrawn, self.retyped
        self.block: list[tuple[Frame, Effect]] = []

    def possible(self, part: Part) -> bool:
        """Whether a surface can be at fault."""
        return not self.isolation.excluded[part.row] if part.at_fault is None else part.at_fault

    def take(self, frame: Frame, of: Effect, observed: bool) -> str | None:
        """A frame; the surface that is named, or `unanticipated`, or None."""
        if not self.surfaces[0].seen:
            before = self.command[(frame.k - observed) * self.rules.n]
            for part in self.surfaces:
                command = np.clip(before[[part.s]], *part.stops)
                part.seen = [Seen(0.0, *part.reach, False, 0.0, 0.0, 0.0, (False, False), command)]
        if observed:
            self.block.append((frame, of))
        if len(self.block) == self.rules.frames:
            self.observe()
            self.block = []
        return self.decide(frame.k)

    # where each surface was

    def observe(self) -> None:
        """See every surface in the elapsed frame, and judge the one before."""
        frames, effects = zip(*self.block, strict=True)
        n, last, T = self.rules.n, frames[-1], self.rules.T
        of = Effect(*(np.mean([getattr(each, part) for each in effects], axis=0) for part in "hZr"))
        eta_bar = np.mean([each.eta_bar for each in frames], axis=0)
        nu = np.mean([each.nu for each in frames], axis=0)
        frame = last._replace(nu=nu, bound=eta_bar + (frames[0].n_before + last.n) / T)
        inside, ks = slice((frames[0].k - 1) * n, last.k * n), [n * each.k for each in frames]
        for part in self.surfaces:
            part.seen.append(
                self.seen(part, frame, of, inside, np.clip(self.command[ks, part.s], *part.stops))
            )
        self.locate(frame, of)
        if len(self.surfaces[0].seen) > 2:
            self.judge(len(self.surfaces[0].seen) - 2)

    def locate(self, frame: Frame, of: Effect) -> None:
        """Correct where the surfaces were, if not each of them alone is at fault."""

    def seen(self, part: Part, frame: Frame, of: Effect, inside: slice, command: np.ndarray) -> Seen:
        """Where a surface was: u = -h / Z, and the positions that explain the frame on every axis; of a block
        on its main axis, and on those on which it has no effect."""
        i, row = part.axis, part.row
        places = part.reach
        for axis in range(3):
            if self.rules.frames == 1 or axis == i or of.Z[row, axis] == 0.0:
                places = meet(places, self.isolation.of_one_frame(row, axis, of, frame))
        G, u, Z = self.G[inside, i, part.s], self.u[inside, part.s], of.Z[row, i]
        width = 2.0 * (frame.bound[i] + of.r[row, i]) / abs(Z)
        shows = bool((np.abs(frame.nu) > frame.bound).any())
        ends, kappa = (u.min(), u.max()), 0.25 * (G.max() - G.min()) / abs(Z)
        return Seen(-of.h[row, i] / Z, *places, shows, *ends, kappa, part.hides(*ends, width), command)

    def judge(self, k: int) -> None:
        """Judge frame k. It counts if a healthy aircraft cannot cause it, and if a fault may begin within a
        frame, neither the one before nor the one after."""
        for part in self.surfaces:
            before, now, after = part.seen[k - 1 : k + 2]
            part.judge(k, now.shows and (self.rules.one_step or (before.shows and after.shows)))
        for part in self.surfaces:
            if any(part.seen[k].hidden):
                part.unhidden = 0

    # which surface, and which type

    def decide(self, k: int) -> str | None:
        """One fault: its surface is named."""
        found = self.find()
        for part in self.surfaces:
            part.conclude(part is found, part.type_of_fault(), k)
        return found.name if isinstance(found, Part) else found

    def sole(self, constant: bool) -> list[Part]:
        """Surfaces that may be the only one at fault; constant: by a constant type."""
        return [p for p in self.surfaces if p.sole and self.possible(p) and (p.constant or not constant)]

    def find(self) -> Part | str | None:
        """The surface at fault. Of several, the one with a constant type, if the others can be dismissed."""
        all_of_them = self.sole(False)
        if len(all_of_them) <= 1:
            for part in all_of_them:
                return part if part.axis != PITCH or part.explains else None
            return UNANTICIPATED
        found = self.sole(True)
        return found[0] if len(found) == 1 and self.dismissed(found[0], all_of_them) else None

    def dismissed(self, part: Part, possible: list[Part]) -> bool:
        """Whether each other surface can only have a fault that leaves no constant deviation, and was given
        the time to show it."""
        others = [one for one in possible if one is not part]
        left = [one for other in others for one in other.left]
        if (self.rules.coarse and left) or not all(other.waited for other in others):
            return False
        wait = max([1, *(one.wait for one in left)])
        return all(one.follows for one in left) and part.count >= wait * self.rules.half

    # the words

    def types_of(self, part: Part) -> list[str]:
        """Names of the types that are possible on a surface. After half a period in which a constant type
        explains the flight, of the varying ones only those that must show themselves or can look like it."""
        left = part.left if self.possible(part) or part.named is not None else []
        constant = {one.name for one in left if one.constant}
        if constant and not self.rules.coarse and part.count >= self.rules.half:
            left = [one for one in left if one.constant or one.must_show or constant & {*one.like}]
        return [*dict.fromkeys(one.name for one in left)]

    def texts_of(self, parts: list[Part]) -> list[str]:
        """SURFACE:TYPE of what is possible on some surfaces."""
        kinds = {
            part.name: self.types_of(part) for part in parts if self.possible(part) or part.named is not None
        }
        found = [text for s, names in kinds.items() for text in ([f"{s}:{name}" for name in names] or [s])]
        return found + ([] if any(kinds.values()) else [UNANTICIPATED])

    def findings(self, name: str | None) -> list["Finding"]:
        """What is said at the end."""
        if name is None:
            return [Finding(None, None, None, self.texts_of(self.surfaces))]
        found = self.of_named()
        return found or [Finding(name, UNANTICIPATED, None, [])]

    def of_named(self) -> list["Finding"]:
        """Findings on the surfaces that are named, the first one first."""
        named = sorted((p for p in self.surfaces if p.named is not None), key=lambda part: part.named)
        return [
            Finding(p.name, p.kind and p.kind.name, p.named, [p.kind.name] if p.kind else self.types_of(p))
            for p in named
        ]
