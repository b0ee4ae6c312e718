"""What of all there is to see is found: beside a test that is told everything of a loss but when it strikes.

    python benchmarks/unknown_instant.py [AIRCRAFT] [--surface S] [--turbulence light] [--flights 20]
        [--healthy 72] [--seed 500000] [--published]

Page's test [Page1954]: the largest log likelihood ratio of "this fault, since some instant" that any instant
has. Where observations have one distribution before and one after, no test has a shorter worst mean delay at
the same mean time between false alarms. It is told surface, magnitude and the design model, and the noise by
the truth's own innovations: a vector autoregression of ORDER frames, fitted to what the design model leaves
of the healthy flights, whitens them and the fault's signature. Errors of the model, gusts and gyros are in it
as they are, not as they are declared. Instants are 0.05 s apart and at most 10 s back.

Flights are those of `beaver-ftc power`. What is declared is what is there: sensors, air, and of the Beaver
the published uncertainty; of other aircraft, which have none, the error of their own model, as fast as
`benchmarks/model_pace.py` measures it (`--published` declares the published one of all). That error is known
within a model's envelope alone, and outside nothing is concluded: losses within a second of which the
aircraft is outside are left out.

Each surface is lost by 40 and 100 % at 3 and 6 deg/s. A row a surface: the share of losses found within 1 s
by the test told the instant too; by Page's; by our two detectors at their level, and as they ship. Levels
give at most 20 false alarms per hour on the healthy flights. Then both of ours as a share of Page's.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import fmean
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import DEFAULT
from beaver_ftc.diagnosis.bounds.clairvoyant import chance
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.studies.compare.replay import Recording, Trace, aware_of_the_air, record, trace
from beaver_ftc.studies.power.chances import level_for
from beaver_ftc.studies.power.survey import (
    BOTH,
    WATCHED_S,
    Block,
    Condition,
    loss,
    scenario_of,
    strikes_at_s,
    with_fdi,
)

MAGNITUDES, EXCITATIONS_DEG_S = (0.4, 1.0), (3.0, 6.0)
PER_H, EVERY, FURTHEST = 20.0, 5, 1000  # false alarms; frames between instants, and back
ORDER, SETTLED, WITHIN_S = 20, 100, 1.0  # frames of the autoregression, and before it is fitted
SHIPPED = 1.0  # our statistic's own alarm level
NONE = dict.fromkeys("pqr", 0.0)
OWN_ALONE = {
    "fdi.bounds.constant_rad_s2": NONE, "fdi.bounds.inertia_coupling": NONE,
    "fdi.statistical.uncertainty_rad_s": 5.0,
}  # fmt: skip


class Whitener(NamedTuple):
    """What is known of noise: from frames before each, (3 ORDER, 3), and the rest's inverse root (3, 3)."""

    before: np.ndarray
    root: np.ndarray

    def respond(self, z: np.ndarray) -> np.ndarray:
        """Accelerations z (n, 3, ...) rad/s2 as they are in the white noise of variance one."""
        rest = z.copy()
        for j, part in enumerate(self.before.reshape(ORDER, 3, 3), start=1):
            rest[j:] -= np.einsum("ki...,io->ko...", z[:-j], part)
        return np.einsum("ki...,io->ko...", rest, self.root)


def fitted(unexplained: list[np.ndarray]) -> Whitener:
    """Of healthy flights, (n, 3) rad/s2 each."""
    past = np.vstack([_past(z)[SETTLED:] for z in unexplained])
    now = np.vstack([z[SETTLED:] for z in unexplained])
    before = np.linalg.lstsq(past, now, rcond=None)[0]
    rest = now - past @ before
    return Whitener(before, np.linalg.inv(np.linalg.cholesky(rest.T @ rest / len(rest))).T)


def _past(z: np.ndarray) -> np.ndarray:
    """The ORDER frames before each, (n, 3 ORDER), the latest first."""
    return np.hstack([np.vstack((np.zeros((j, 3)), z[:-j])) for j in range(1, ORDER + 1)])


def unexplained(recording: Recording) -> np.ndarray:
    """What the design model leaves of each frame's acceleration, (frames - 1, 3) rad/s2."""
    x, expected = (
        np.array([getattr(m, of_it) for m, _ in recording.seen]) for of_it in ("x", "acceleration")
    )
    return np.diff(x, axis=0) / recording.context.dt_s - expected[1:]


def signature(recording: Recording, surface: str) -> np.ndarray:
    """What a total loss of a surface would have done in each frame, (frames - 1, 3) rad/s2."""
    place = recording.context.surfaces.index(surface)
    return -np.array([measured.contribution[:, place] for measured, _ in recording.seen[1:]])


def ratios(recording: Recording, surface: str, noise: Whitener) -> dict[float, np.ndarray]:
    """Of each magnitude the largest log likelihood ratio, at every frame (n,)."""
    g = noise.respond(unexplained(recording))
    moment = signature(recording, surface)
    n = len(moment)
    since = np.arange(0, n, EVERY)
    there = np.arange(n)[:, None] >= since
    response = noise.respond(moment[:, :, None] * there[:, None, :])
    N = np.cumsum(np.einsum("kis,ki->ks", response, g), axis=0)
    D = np.cumsum(np.square(response).sum(axis=1), axis=0)
    late = there & (np.arange(n)[:, None] - since < FURTHEST)
    return {
        m: np.concatenate(([0.0], np.where(late, m * N - 0.5 * m * m * D, 0.0).max(axis=1)))
        for m in MAGNITUDES
    }


def deflection(recording: Recording, surface: str, noise: Whitener) -> float:
    """How far a total loss stands out of the noise WITHIN_S after it struck (clairvoyant.py)."""
    t = np.array([measured.t_s for measured, _ in recording.seen[1:]])
    struck = signature(recording, surface) * (t > recording.fault_at_s + 1e-9)[:, None]
    soon = t <= recording.fault_at_s + WITHIN_S + 1e-9
    return float(np.sqrt(np.square(noise.respond(struck)[soon]).sum()))


@dataclass(frozen=True)
class Survey:
    """Which aircraft in which air, how many flights a cell and in health; flights' seeds begin at `seed`."""

    aircraft: str
    turbulence: str
    flights: int
    healthy: int
    seed: int
    published: bool = False

    def flown(self, block: Block, duration_s: float, faults: list[dict]) -> Recording:
        """A flight as shown to plug-ins, the vanes' view of the air included where they have one."""
        flight = scenario_of(block, duration_s, faults, {"aircraft": self.aircraft})
        own_alone = {} if self.published or self.aircraft == DEFAULT else OWN_ALONE
        recording = record(with_fdi(flight, BOTH).with_(own_alone))
        return recording if recording.air is None else aware_of_the_air(recording)

    def block(self, excitation_deg_s: float, number: int) -> Block:
        return Block(Condition("tactical-grade", self.turbulence), excitation_deg_s, self.seed + number)

    def in_health(self) -> list[Recording]:
        """Flights without a fault."""
        speeds = EXCITATIONS_DEG_S * self.healthy
        return [self.flown(self.block(speeds[i], 100_000 + i), 18.0, []) for i in range(self.healthy)]

    def lost(self, surface: str) -> Iterator[tuple[float, Recording]]:
        """Magnitude of the loss and the flight."""
        for excitation in EXCITATIONS_DEG_S:
            for number in range(self.flights):
                block = self.block(excitation, 1000 * int(excitation) + number)
                at_s = strikes_at_s(block)
                for magnitude in MAGNITUDES:
                    yield magnitude, self.flown(block, at_s + WATCHED_S, [loss(surface, magnitude, at_s)])


def is_known(recording: Recording) -> bool:
    """Whether the model's error is known until WITHIN_S after the fault struck."""
    t = np.array([measured.t_s for measured, _ in recording.seen])
    soon = np.abs(t - recording.fault_at_s - 0.5 * WITHIN_S) <= 0.5 * WITHIN_S + 1e-9
    return bool(recording.known[soon].all())


def share(seen: list[tuple[Trace, float]]) -> float:
    """Of traces with their levels: how many alarm within WITHIN_S."""
    return fmean(trace.delay_s(level) <= WITHIN_S + 1e-9 for trace, level in seen)


def shares_of(survey: Survey, surface: str, healthy: list[Recording], noise: Whitener) -> list[float]:
    """What is found of a surface's losses: told the instant, all but it, ours at its level, as it ships; and
    how many count, of how many."""
    page: dict[float, list[Trace]] = {magnitude: [] for magnitude in MAGNITUDES}
    for recording in healthy:
        for magnitude, statistic in ratios(recording, surface, noise).items():
            page[magnitude].append(trace(recording, statistic))
    levels = {magnitude: level_for(traces, PER_H).level for magnitude, traces in page.items()}
    ours = level_for([trace(one, one.built_in) for one in healthy], PER_H).level
    told, seen, built_in = list[float](), list[tuple[Trace, float]](), list[Trace]()
    lost = list(survey.lost(surface))
    for magnitude, recording in ((m, one) for m, one in lost if is_known(one)):
        statistic = ratios(recording, surface, noise)[magnitude]
        seen.append((trace(recording, statistic), levels[magnitude]))
        told.append(chance(magnitude * deflection(recording, surface, noise), WITHIN_S, PER_H))
        built_in.append(trace(recording, recording.built_in))
    at_ours, shipped = ([(one, level) for one in built_in] for level in (ours, SHIPPED))
    return [fmean(told), share(seen), share(at_ours), share(shipped), len(told), len(lost)]


def main() -> None:
    """Print a row a surface."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("aircraft", nargs="?", default="beaver")
    parser.add_argument(
        "--surface", action="append", help="once a surface; without it all that the class has"
    )
    parser.add_argument("--turbulence", default="light", choices=("none", "light", "moderate", "severe"))
    parser.add_argument("--flights", type=int, default=20, help="of each surface, magnitude and excitation")
    parser.add_argument("--healthy", type=int, default=72)
    parser.add_argument("--seed", type=int, default=500_000)  # others than those of `power`
    parser.add_argument("--published", action="store_true")
    args = parser.parse_args()
    survey = Survey(args.aircraft, args.turbulence, args.flights, args.healthy, args.seed, args.published)
    healthy = survey.in_health()
    noise = fitted([unexplained(one) for one in healthy])
    for surface in args.surface or find_aircraft(args.aircraft).class_of_losses:
        told, page, ours, shipped, known, flown = shares_of(survey, surface, healthy, noise)
        print(
            f"{args.aircraft}, {surface}, {known} of {flown} losses, within {WITHIN_S:g} s: "
            f"told the instant {told:.0%}, all but the instant {page:.0%}, "
            f"both detectors {ours:.0%}, as they ship {shipped:.0%}: "
            f"{ours / page:.0%} and {shipped / page:.0%}",
            flush=True,
        )


if __name__ == "__main__":
    main()
