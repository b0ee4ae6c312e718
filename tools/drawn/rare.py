"""Rare events: do the intervals of `sweep --rare` hold, and is its estimate that of a million plain flights?

    python -m tools.drawn.rare [--repeats N] [--plain N] [--seed S] [--all] [--jobs N]

Of problems whose probability is known: in how many repeats the 95 % interval holds it, how many estimates are
within a factor of two, and what they cost. Then short flights with a biased elevator at several airspeeds and
altitudes, whose pitch rate passes a limit once in 10^5. Of N plain flights drawn, those are flown whose bias
is beyond 3.2 standard deviations, and as many of the others, half of them those with the largest bias, which
have to stay away from the limit: the rate follows the bias, so that the rest, nearer to no bias, cannot pass
it. The last line says how many were flown; with --all every one is, in an hour or two. Exit status 1 if fewer
than 90 in 100 intervals hold, an estimate is not within a factor of two of the plain flights or takes more
than a hundredth of them, or one of the others comes near the limit.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.stats import chi2, norm

from beaver_ftc.scenario.sweeps import Sweep, load_sweep
from beaver_ftc.studies.sweep.rare import Chains, run_rare, scenario_at, score_of

ANALYTIC: dict[str, tuple[Callable[[np.ndarray], np.ndarray], int, float]] = {
    "a sum of two": (lambda u: u.sum(1) / math.sqrt(2) - norm.isf(1e-5), 2, 1e-5),
    "a sum of ten": (lambda u: u.sum(1) / math.sqrt(10) - norm.isf(1e-5), 10, 1e-5),
    "two sides": (lambda u: np.abs(u[:, 0]) - norm.isf(5e-5), 3, 1e-4),
    "a sphere": (lambda u: (u**2).sum(1) - chi2.isf(1e-5, 4), 4, 1e-5),
    "in steps": (lambda u: np.floor(8 * (u[:, 0] - norm.isf(1e-3))) / 8, 2, 1e-3),
}
EXPECTATION, LIMIT_DEG_S = "post_fault_rms_deg_s.q", 5.1
FAR = 3.2  # standard deviations of the bias beyond which every flight drawn is flown
NEAR = -0.05  # the score of a flight that comes near the event
SWEEP: dict[str, Any] = {
    "name": "biased",
    "base": {
        "name": "biased", "duration_s": 0.2, "rate_hz": 50, "control": {"law": "nominal"},
        "fdi": {"scheme": "none"}, "expect": {"post_fault_rms_deg_s": {"q": LIMIT_DEG_S}},
        "faults": [{"actuator": "elevator", "type": "bias", "bias_deg": 0.1, "at_s": 0}],
    },
    "runs": 1,
    "vary": {
        "faults[0].bias_deg": {"normal": [0, 1]},
        "initial.airspeed_mps": {"uniform": [40, 50]},
        "initial.altitude_m": {"uniform": [500, 2500]},
    },
}  # fmt: skip


def main() -> None:
    """Repeat, fly, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--plain", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    args = parser.parse_args()
    good = True
    for problem, (_, keys, probability) in ANALYTIC.items():
        held, near, flights = repeated(problem, args.repeats)
        print(
            f"{problem}, {keys} keys, {probability:g}: interval held in {held} of {args.repeats}, "
            f"{near} within a factor of two, {flights / args.repeats:.0f} flights each"
        )
        good &= held >= 0.9 * args.repeats
    if args.plain:
        good &= against_plain(args.plain, args.seed, args.all, args.jobs)
    raise SystemExit(not good)


def repeated(problem: str, repeats: int) -> tuple[int, int, int]:
    """In how many repeats the interval holds the probability, the estimate is near; flights of all."""
    score, keys, probability = ANALYTIC[problem]
    held = near = flights = 0
    for seed in range(repeats):
        chains = Chains(keys, seed)
        chains.go(lambda _, points: score(points))
        found = chains.estimate()
        held += found.low <= probability <= found.high
        near += 0.5 < found.probability / probability < 2
        flights += found.flights
    return held, near, flights


def against_plain(drawn: int, seed: int, whole: bool, jobs: int) -> bool:
    """One event of flights, by subset simulation and by plain flights."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "biased.yaml"
        path.write_text(yaml.safe_dump(SWEEP | {"seed": seed}))
        sweep = load_sweep(path)
        found = run_rare(sweep, EXPECTATION, Path(folder))
    events, nearest, flown = plain(sweep, drawn, seed, whole, jobs)
    p, share = found["probability"], events / drawn
    print(
        f"pitch rate above {LIMIT_DEG_S:g} deg/s: {p:.2g}, 95 % {found['low']:.2g} to {found['high']:.2g}, "
        f"by {found['flights']} flights; plain {events} of {drawn}, {flown} flown, others to {nearest:.2f}"
    )
    return (
        0.5 <= p / share <= 2.0 and found["flights"] <= 0.01 * drawn and nearest < NEAR if events else False
    )


def plain(sweep: Sweep, drawn: int, seed: int, whole: bool, jobs: int) -> tuple[int, float, int]:
    """Events among the flights drawn; the largest score of those flown of the others; how many were flown."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((drawn, len(sweep.keys)))
    far = np.abs(points[:, 0]) > FAR
    near = points[~far]
    half = int(far.sum()) // 2
    others = near if whole else np.concatenate([near[np.argsort(-np.abs(near[:, 0]))[:half]], near[:half]])
    of_far, of_others = (scores(sweep, part, jobs) for part in (points[far], others))
    events = (of_far >= 0.0).sum() + (of_others >= 0.0).sum()
    return int(events), float(of_others.max()), int(far.sum()) + len(others)


def scores(sweep: Sweep, points: np.ndarray, jobs: int) -> np.ndarray:
    """Of flights (n, keys), flown in so many processes; every 10,000 flights a word of progress."""
    found: list[float] = []
    with ProcessPoolExecutor(jobs) as pool:
        for score in pool.map(partial(score_at, sweep), range(len(points)), points.tolist(), chunksize=500):
            found.append(score)
            if len(found) % 10_000 == 0:
                print(len(found), f"to {max(found):.3f}", file=sys.stderr, flush=True)
    return np.array(found)


def score_at(sweep: Sweep, run: int, point: list[float]) -> float:
    """Of one flight."""
    return score_of(scenario_at(sweep, run, point), EXPECTATION)


if __name__ == "__main__":
    main()
