"""The statistical detector: alarm, and which fault. Page: statistical.md."""

from math import exp
from statistics import NormalDist

import numpy as np

from reference.declaration import Declaration
from reference.likelihood import CUBE, ENDING, GROUPS, GROWING, LOSS, STEP, Group
from reference.noise import Noise, tests_of_groups
from reference.parity import Parity, Rows
from reference.prediction import Frames

LEAST_SHARE = 0.25


class Statistical:
    """The detector of one flight, frame by frame."""

    def __init__(self, declaration: Declaration, noise: Noise, frames: Frames, rows: Rows) -> None:
        self.declaration, self.frames, self.noise, self.z = declaration, frames, noise, noise.z
        share = declaration["statistical.misnaming"] * declaration.dt / tests_of_groups(declaration)
        self.margin = NormalDist().inv_cdf(share) ** 2 / 2.0
        self.groups = [Group(noise, axes, j == 2) for j, axes in enumerate(GROUPS)]
        self.parity = Parity(rows, self.margin)
        self.alarmed, self.axis, self.largest = False, None, 0.0
        self.confirmed: set[int] = set()
        self.weak: set[int] = set()
        self.abrupt = declaration["fault_profile"] == "abrupt"

    def effects(self, k: int) -> tuple[np.ndarray, float]:
        """G of the frame before times the mean positions of this one, (3, surfaces), 0 in the first frame;
        and the pitch acceleration of a coefficient 1 on alpha^3."""
        G, u = self.frames.G, self.frames.u
        before = G[k - 1] if k > 1 else np.zeros_like(G[k])
        model, y = self.noise.model, self.noise.y[k * self.declaration.n]
        return before * u[k], model.inertia["Qm"] * y[3] * model.aircraft.S * model.aircraft.c * y[0] ** 3

    def take(self, k: int, nu: np.ndarray) -> dict[str, float]:
        """Frame k; the shares of the alarm level by column. Outside the boxes of a derived model no alarm."""
        Gu, cube = self.effects(k)
        box = self.noise.bounds.box
        concludes = box is None or box[k * self.declaration.n] >= 0
        forgetting = exp(-self.declaration.dt / self.declaration["forgetting_time_s"])
        forget = forgetting if self.alarmed else 1.0
        air = self.noise.gusts.effect[k] if self.noise.gusts else 0.0
        mapped = self.noise.bounds.box is not None and not self.declaration.aircraft.file.get("damage")
        for group in self.groups:
            if not self.alarmed:
                group.restart(k)
            group.take(group.seen(k, nu - air, Gu, cube), forget)
            group.judge()
            group.compare(0.0 if self.abrupt else forgetting, mapped)
        self.parity.take(k, forget, not self.alarmed)
        return self._shares(concludes)

    def _shares(self, concludes: bool) -> dict[str, float]:
        """The shares of the alarm level by column; axis and size of the largest, if the detector `concludes`
        with an alarm."""
        scores = [
            (fault, score)
            for group in self.groups
            for fault, score in zip(group.faults, group.score, strict=True)
            if fault.alarms
        ]
        scores += [(view.faults[0], self.parity.alarm_score(view)) for view in self.parity.views]
        names = [f"{one.name}_{LOSS}" for one in self.declaration.losses] + [
            f"{axis}_{STEP}" for axis in "pqr"
        ]
        columns = dict.fromkeys([f"{name}_likelihood_share" for name in names], 0.0)
        self.largest, self.axis = 0.0, None
        for fault, score in scores:
            name, share = (
                (*self.declaration.aircraft.surfaces, "pqr"[fault.axis])[fault.surface],
                score / self.z,
            )
            column = f"{name}_{fault.kind}_likelihood_share"
            columns[column] = max(columns[column], share)
            if concludes and share > self.largest:
                self.largest, self.axis = share, fault.axis
        self.alarmed |= self.largest > 1.0
        return columns

    def alternative(self, group: Group, s: int, excluded: set[int]) -> float:
        """Largest lower bound of what is no loss of surface s; excluded losses do not count."""
        return group.largest(
            "lower",
            lambda fault: (
                fault.kind in (STEP, CUBE)
                or (fault.kind == LOSS and fault.surface != s and fault.surface not in excluded)
            ),
        )

    def excludes(self, k: int, s: int, excluded: set[int]) -> bool:
        """Which fault: whether, after the alarm, the likelihoods exclude a loss of surface s, which is not
        confirmed; of all types, whether a parity direction excludes surface s.

        A loss whose exclusion only the end of a loss in pitch would prevent is weak: it is not named."""
        if self.declaration.all_types:
            return self.parity.excludes(s, self.frames.G[k][:, s], k - 1)
        if not self.alarmed:
            return False
        if s not in self.confirmed and (s in self.weak or not self.abrupt) and self.confirms(s, excluded):
            self.confirmed.add(s)
        if s in self.confirmed or not self._beaten(s, excluded, False):
            return False
        self.weak.add(s)
        return self._beaten(s, excluded, True)

    def confirms(self, s: int, excluded: set[int]) -> bool:
        """Confirmed loss: in a group, its lower bound exceeds that of all others by the margin."""
        return any(
            group.largest("lower", lambda fault: fault.surface == s and fault.kind in (LOSS, GROWING))
            - self.alternative(group, s, excluded)
            > self.margin
            for group in self.groups
        )

    def _beaten(self, s: int, excluded: set[int], with_end_in_pitch: bool) -> bool:
        """Margin: each group of roll and yaw is judged with that of pitch. Upper bounds of the loss, and of
        its end, against the lower bound of the best alternative."""
        pitch, one_step = self.groups[0], self.declaration.n == 1
        loss_share = 1.0 if self.abrupt and one_step else LEAST_SHARE
        end_share = 1.0 if one_step else LEAST_SHARE
        for lateral in self.groups[1:]:
            best = max(self.alternative(group, s, excluded) for group in (pitch, lateral))

            def upper(group: Group, end: bool) -> float:
                return group.largest("upper", lambda f: f.surface == s and (f.kind == ENDING) == end)

            loss = max(upper(pitch, False), upper(lateral, False))
            end = max(upper(lateral, True), upper(pitch, True) if with_end_in_pitch else 0.0)
            if loss < loss_share * best and end < end_share * best and best - max(loss, end) > self.margin:
                return True
        return False

    def theta(self, s: int) -> float:
        """Estimate of a loss: that of the group with the most information."""
        found, most = 0.0, 0.0
        for group in self.groups:
            for fault, theta, D in zip(group.faults, group.theta, group.information, strict=True):
                if fault.kind == LOSS and fault.surface == s and most < D:
                    found, most = theta, D
        return float(found)
