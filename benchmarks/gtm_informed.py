"""Which damage can a test detect that knows the damage, but not its instant?

`python -m tools.docs table gtm-damage-informed` prints the table. The flights are those of gtm_damage.py;
each is flown again with the nominal law, and recorded as a detector sees it. The test knows the case, its
effect on the angular acceleration, and the noise. The effect is computed from the true flight by the
specification (tools/gtm: moments, mass, centre of gravity and inertia, with the damage minus without it) in
every third frame, with straight lines between. The noise, which contains the errors of the model, is a vector
autoregression that is fitted to flights without damage at that speed. The test is Page's
(page_test.py). A likelihood ratio that begins at one instant ever reaches h with a probability of at
most exp(-h) [Ville]. With an instant in each frame, h = ln(frames per hour / alarms per hour) therefore gives
at most the declared rate of false alarms. The level of a case is this h, or the largest value before the
damage in any flight of the case, if that is larger.

The test knows the error of the model. A detector knows only a bound on it: an error within the bound may hide
the damage, except for the part of its effect that exceeds the bound. `certain` is the chance that the same
test finds this part within 1 s, in each flight, with our law, in which our diagnosis is late. Its log
likelihood ratio is normal with mean d^2 / 2 and variance d^2. No detector that relies on the declared bound
has a larger chance. Where the error of the model is not known, no part exceeds the bound.

A row for each case has the flights, those that our diagnosis and the informed test detect within 1 s, and the
sum of the chances over the flights in which ours is late. Rows that the file has are not flown again. The
variable BEAVER_FTC_GTM must be set, and the aircraft `gtm` must be there.
"""

import json
from collections.abc import Callable, Iterator
from functools import cache
from math import cos, degrees, log, sin
from pathlib import Path
from statistics import NormalDist

import numpy as np
from benchmarks.gtm_damage import M_S_PER_KT, SEEDS, Document, rows_in, scenario
from benchmarks.page_test import Whitener, fitted, largest_ratios, unexplained
from benchmarks.unknown_instant import WITHIN_S
from tools.gtm.flights import CASES, NAMES
from tools.gtm.specification import Controls, Specification, folder

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.scenario.schema import load_text
from beaver_ftc.studies.compare.replay import Recording, record, trace

M_PER_FT = 0.3048
BANDS_KT = (70.0, 80.0, 90.0, 100.0, 110.0)  # the noise is fitted between two
HEALTHY = 16  # flights a band that fit it
EACH = 3  # frames between two of which the effect is worked out
DT_S = 0.01
PER_H = 1e-3  # false alarms, as ours declares
LEVEL = log(3600.0 * 100.0 / PER_H)


def recorded(given: Document) -> Recording:
    """A flight, recorded as a detector sees it."""
    return record(load_text(json.dumps(given)))


@cache
def noise(band: int) -> Whitener:
    """The noise model of flights without damage in a band of speeds."""
    low, high = (knots * M_S_PER_KT for knots in BANDS_KT[band : band + 2])
    flights = (scenario(k, seed=SEEDS[0] + 1000) | {"faults": []} for k in range(100 * HEALTHY))
    there = [one for one in flights if low <= one["initial"]["airspeed_mps"] < high][:HEALTHY]
    return fitted([unexplained(recorded(one)) for one in there])


def band_of(given: Document) -> int:
    """The number of the band of speeds in which a flight begins."""
    found = np.searchsorted(BANDS_KT, given["initial"]["airspeed_mps"] / M_S_PER_KT) - 1
    return int(np.clip(found, 0, len(BANDS_KT) - 2))


def effect(spec: Specification, given: Document, case: int) -> np.ndarray:
    """The effect that the damage has, or would have, on the angular acceleration in each frame except the
    first, (frames - 1, 3) rad/s2."""
    log = {name: np.asarray(of) for name, of in bf.fly(load_text(json.dumps(given))).log.items()}
    names = [f"{name}_pos_rad" for name in NAMES.values()]
    frames = np.arange(len(log["t_s"]) - 1)
    some = frames[::EACH]
    known = np.array([_effect(spec, log, names, case, k) for k in some])
    return np.column_stack([np.interp(frames, some, of) for of in known.T])


def _effect(
    spec: Specification, log: dict[str, np.ndarray], names: list[str], case: int, k: int
) -> np.ndarray:
    """What the damage adds to the angular accelerations in frame k, by the specification."""
    at = {name: float(of[k]) for name, of in log.items() if name in _STATE}
    V, a, b = at["airspeed_mps"] / M_PER_FT, at["alpha_rad"], at["beta_rad"]
    velocity = [V * cos(a) * cos(b), V * sin(b), V * sin(a) * cos(b)]
    rest = [at[name] for name in _STATE[3:-1]]
    x = np.array([*velocity, *rest, at["altitude_m"] / M_PER_FT])
    surfaces = {s: degrees(float(log[name][k])) for s, name in zip(NAMES, names, strict=True)}
    controls = Controls(surfaces, (100.0 * float(log["throttle"][k]),) * 2)
    with_it, without = (spec.rates_of_change(x, controls, which)[3:6] for which in (case, 0))
    return with_it - without


_STATE = (
    "airspeed_mps", "alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "theta_rad",
    "psi_rad", "altitude_m",
)  # fmt: skip


def deflected(late_s: np.ndarray, does: np.ndarray, white: Whitener) -> float:
    """Deflection d of an effect `does` (n, 3) rad/s2 until WITHIN_S after the damage, in standard deviations
    of the noise. late_s (n,): time of each frame after the damage, s."""
    response = white.respond(does * (late_s > 1e-9)[:, None])
    return float(np.sqrt(np.square(response[late_s <= WITHIN_S + 1e-9]).sum()))


def bounds_in(given: Document) -> np.ndarray:
    """The bound on the error of the model in each frame of a flight, (frames - 1, 3) rad/s2: the smaller one
    of those at its two ends."""
    there: list[np.ndarray] = []

    def watch(loop: Loop) -> Callable[[], None]:
        error_map = loop.frames["fdi"]["bound"]["error_map"]
        loop.after_frame = lambda: there.append(error_map["e_now"][0].copy())
        return lambda: None

    fly(load_text(json.dumps(given)), watch=watch)
    return np.minimum(there[:-1], there[1:])


def beyond(k: int, spec: Specification, case: int) -> float:
    """Deflection of the part of the damage in flight number k that exceeds the bound."""
    given = shortened(k)
    does, bound = effect(spec, given, case), bounds_in(given)
    n = min(len(does), len(bound))
    left = np.sign(does[:n]) * np.maximum(np.abs(does[:n]) - bound[:n], 0.0)
    late_s = (np.arange(n) + 1) * DT_S - given["faults"][0]["at_s"]
    return deflected(late_s, left, noise(band_of(given)))


def shortened(k: int) -> Document:
    """Flight number k, cut off a second after its damage."""
    given = scenario(k)
    return given | {"duration_s": round(given["faults"][0]["at_s"] + WITHIN_S + 0.05, 2)}


def seen(k: int, spec: Specification, late: bool) -> Document:
    """The row of flight number k: the largest value of the informed test before the damage, and within
    WITHIN_S after it; `beyond` if our diagnosis was late."""
    given = shortened(k) | {"control": {"law": "nominal"}}
    damage = given["faults"][0]
    case = CASES.index(damage["case"]) + 1
    recording, white = recorded(given), noise(band_of(given))
    does = effect(spec, given, case)[: len(recording.seen) - 1]
    of_it = trace(recording, largest_ratios(recording, does, white)[1.0])
    return {
        "k": k, "before": of_it.before,
        "after": max((value for late, value in of_it.records if late <= WITHIN_S + 1e-9), default=0.0),
        "beyond": beyond(k, spec, case) if late else None,
    }  # fmt: skip


def rows(ours: dict[int, Document], of: dict[int, Document]) -> Iterator[list[str]]:
    """Yield a row for each case, and one for all."""
    total = np.zeros(4)
    for case in load("gtm").damage:
        there = [k for k in of if ours[k]["case"] == case]
        level = level_of([of[k] for k in there])
        row = np.array([
            len(there), sum(not is_late(ours[k]) for k in there), sum(of[k]["after"] > level for k in there),
            sum(certain(of[k], level) for k in there if is_late(ours[k])),
        ])  # fmt: skip
        total += row
        yield _printed(case, row)
    yield _printed("all", total)


def is_late(row: Document) -> bool:
    """Whether our diagnosis did not detect the damage within WITHIN_S."""
    return row["delay_s"] is None or row["delay_s"] > WITHIN_S + 1e-9


def level_of(rows_of_case: list[Document]) -> float:
    """The level of the informed test for a case."""
    return max([LEVEL, *(row["before"] for row in rows_of_case)])


def certain(row: Document, level: float) -> float:
    """The chance that the informed test finds the part of the effect that exceeds the bound."""
    d = row["beyond"]
    return NormalDist().cdf((0.5 * d * d - level) / d) if d > 0.0 else 0.0


def _printed(case: str, row: np.ndarray) -> list[str]:
    return [case, *(str(int(n)) for n in row[:3]), f"{row[3]:.1f}"]


def see_all(ours: dict[int, Document], out: Path) -> dict[int, Document]:
    """The rows of the informed test on our flights, by number: those in the file, and new ones, which are
    added to it."""
    where = folder()
    assert where is not None
    spec = Specification(where)
    return rows_in(out, ours, lambda k: seen(k, spec, is_late(ours[k])))
