"""What not knowing the instant costs: the test told the fault, and one told all of it but when it strikes.

The latter is Page's [Page1954]: the largest log likelihood ratio of "this fault, since some instant" that any
instant has. Where observations have one distribution before and one after, no test has a shorter worst mean
delay at the same mean time between false alarms. It is told surface and magnitude, and has the filter of
`diagnosis/bounds/clairvoyant.py`; instants are 0.05 s apart and at most 10 s back. Its level gives at most 20
false alarms per hour on healthy flights, as in `beaver-ftc power`.

    python benchmarks/unknown_instant.py [BLOCKS] [HEALTHY_FLIGHTS]
"""

import sys
from collections.abc import Iterator
from statistics import fmean

import numpy as np

from beaver_ftc.diagnosis.bounds.clairvoyant import Whitening, chance
from beaver_ftc.studies.compare.replay import Recording, Trace, aware_of_the_air, record, trace
from beaver_ftc.studies.power.chances import level_for
from beaver_ftc.studies.power.survey import (
    STATISTICAL,
    WATCHED_S,
    WITHIN_S,
    Block,
    Condition,
    deflections,
    loss,
    scenario_of,
    strikes_at_s,
    with_fdi,
)

LIGHT = Condition("tactical-grade", "light")
SURFACES, MAGNITUDES, EXCITATIONS_DEG_S = {"aileron": 0, "rudder": 2}, (0.4, 1.0), (3.0, 6.0)
PER_H, EVERY, FURTHEST = 20.0, 5, 1000  # false alarms; frames between instants, and back
SEED = 500_000  # others than those of `power`


def flown(block: Block, duration_s: float, faults: list[dict]) -> Recording:
    """A flight as shown to plug-ins, the vanes' view of the air included."""
    return aware_of_the_air(record(with_fdi(scenario_of(block, duration_s, faults), STATISTICAL)))


def ratios(recording: Recording, surface: str) -> dict[float, np.ndarray]:
    """Of each magnitude the largest log likelihood ratio, at every frame (n,)."""
    seen = [measured for measured, _ in recording.seen]
    whitening, dt = Whitening(recording.context), recording.context.dt_s
    x, expected = (np.array([getattr(m, of_it) for m in seen]) for of_it in ("x", "acceleration"))
    g = whitening.respond(np.diff(x, axis=0) / dt - expected[1:])
    moment = -np.array([measured.contribution[:, SURFACES[surface]] for measured in seen[1:]])
    n = len(moment)
    since = np.arange(0, n, EVERY)
    there = np.arange(n)[:, None] >= since
    response = whitening.respond(moment[:, :, None] * there[:, None, :])
    N = np.cumsum(np.einsum("kis,ki->ks", response, g), axis=0)
    D = np.cumsum(np.square(response).sum(axis=1), axis=0)
    late = there & (np.arange(n)[:, None] - since < FURTHEST)
    return {
        m: np.concatenate(([0.0], np.where(late, m * N - 0.5 * m * m * D, 0.0).max(axis=1)))
        for m in MAGNITUDES
    }


def healthy(flights: int) -> dict[tuple[str, float], list[Trace]]:
    """Traces without a fault, by surface and magnitude."""
    found: dict[tuple[str, float], list[Trace]] = {(s, m): [] for s in SURFACES for m in MAGNITUDES}
    for i in range(flights):
        block = Block(LIGHT, EXCITATIONS_DEG_S[i % len(EXCITATIONS_DEG_S)], SEED + 100_000 + i)
        recording = flown(block, 18.0, [])
        for surface in SURFACES:
            for magnitude, statistic in ratios(recording, surface).items():
                found[surface, magnitude].append(trace(recording, statistic))
    return found


def faulted(blocks: int) -> Iterator[tuple[str, float, Trace, list[float]]]:
    """Surface, magnitude, the trace and the deflections of the test that is told the instant as well."""
    for excitation in EXCITATIONS_DEG_S:
        for seed in range(blocks):
            block = Block(LIGHT, excitation, SEED + 1000 * int(excitation) + seed)
            at_s = strikes_at_s(block)
            for surface in SURFACES:
                for magnitude in MAGNITUDES:
                    recording = flown(block, at_s + WATCHED_S, [loss(surface, magnitude, at_s)])
                    statistic = ratios(recording, surface)[magnitude]
                    d = deflections(recording, surface, magnitude, WITHIN_S)
                    yield surface, magnitude, trace(recording, statistic), d


def main(blocks: int = 20, flights: int = 72) -> None:
    """Print, for each surface and delay, what either test finds."""
    levels = {key: level_for(traces, PER_H).level for key, traces in healthy(flights).items()}
    rows = list(faulted(blocks))
    for surface in SURFACES:
        here = [(magnitude, seen, d) for s, magnitude, seen, d in rows if s == surface]
        for w, within_s in enumerate(WITHIN_S):
            delays = [seen.delay_s(levels[surface, magnitude]) for magnitude, seen, _ in here]
            found = fmean(delay <= within_s + 1e-9 for delay in delays)
            told = fmean(chance(d[w], within_s, PER_H) for _, _, d in here)
            print(
                f"{surface}, {len(here)} losses, within {within_s:g} s: told the instant {100 * told:.0f} %, "
                f"all but the instant {100 * found:.0f} %: {100 * found / told:.0f} % of it"
            )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
