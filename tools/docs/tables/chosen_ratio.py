"""Tables of docs/results/choices.md: what another RATIO of the default law would bring, and cost."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import exp
from statistics import fmean
from unittest.mock import patch

import numpy as np

from beaver_ftc.control.laws import loop_design
from beaver_ftc.diagnosis.rivals import FLIGHT_GRADES
from beaver_ftc.plugins import LAWS
from beaver_ftc.studies.compare.criteria import LawCost, effort, flights, fly_entry, least_margins
from beaver_ftc.studies.compare.gain import geometric_mean, relative_gain
from beaver_ftc.studies.compare.trial import LAW, SCHEME, Entry
from beaver_ftc.studies.present.tables import markdown_table

RATIOS, RATIO_DRAWS = (3.0, 4.5, 6.5, 9.0, 13.0, 20.0), (101, 102)


def chosen_ratio() -> str:
    """Error of the default law over the oracle's, by RATIO of its observer, on flights that chose nothing."""
    return _of_ratios(None)


def chosen_ratio_probe() -> str:
    """The same of one flight of each sweep."""
    return _of_ratios(1)


def _of_ratios(most: int | None) -> str:
    costs = {grade: [LawCost(LAW, grade, most, draw) for draw in RATIO_DRAWS] for grade in FLIGHT_GRADES}
    rows = [
        (f"{ratio:g}", *(f"{exp(fmean(_parts(of, ratio))):.2f}" for of in costs.values())) for ratio in RATIOS
    ]
    return markdown_table(("RATIO", *(f"`{grade}`" for grade in FLIGHT_GRADES)), rows)


BETTER_RATIO, BETTER_DRAWS = 9.0, (103, 104, 105, 106)
BETTER_HEAD = (
    "grade", "gain, %", "from, %", "to, %", "flights", "surface rate", "gain margin, dB", "phase margin, deg",
)  # fmt: skip


def chosen_ratio_gain() -> str:
    """What the default law gains by another RATIO, on draws that neither chose it nor are in the table above;
    how fast its surfaces then move, over how fast they do now; and its margins."""
    return markdown_table(BETTER_HEAD, [_of_better(grade, None) for grade in FLIGHT_GRADES])


def chosen_ratio_gain_probe() -> str:
    """The same of one flight of each sweep."""
    return markdown_table(BETTER_HEAD, [_of_better(grade, 1) for grade in FLIGHT_GRADES])


def _of_better(grade: str, most: int | None) -> tuple[str, ...]:
    """The row of a grade: by how much the other ratio tracks better, and what it costs."""
    ratios = loop_design.RATIO, BETTER_RATIO
    costs = [LawCost(LAW, grade, most, draw) for draw in BETTER_DRAWS]
    built_in, better = (np.array(_parts(costs, ratio)) for ratio in ratios)
    gain = relative_gain(built_in, better, geometric_mean)
    shares = (f"{100.0 * share:.1f}" for share in (gain.value, gain.low, gain.high))
    before, after = (_effort(grade, most, ratio) for ratio in ratios)
    with _observer_ratio(BETTER_RATIO):
        gain_db, phase_deg = least_margins(costs[0].margins({}))
    kept = f"{after / before:.2f}", f"{gain_db:.1f}", f"{phase_deg:.0f}"
    return f"`{grade}`", *shares, str(len(better)), *kept


def _parts(costs: list[LawCost], ratio: float) -> list[float]:
    """Logarithm of the law's error over the oracle's, which keeps its own RATIO, in each flight."""
    with _observer_ratio(ratio):
        return [part for cost in costs for part in cost.parts({})]


def _effort(grade: str, most: int | None, ratio: float) -> float:
    """RMS rate of all surfaces over the same flights, deg/s."""
    cases = [case for draw in BETTER_DRAWS for case in flights(grade, most, draw) if case.scenario.faults]
    with _observer_ratio(ratio):
        return effort([fly_entry(case, Entry(SCHEME, LAW), LAWS, {}) for case in cases])


@contextmanager
def _observer_ratio(ratio: float) -> Iterator[None]:
    """RATIO of the default law, for the flights inside."""
    try:
        with patch.object(loop_design, "RATIO", ratio):
            loop_design.candidates.cache_clear()
            yield
    finally:
        loop_design.candidates.cache_clear()
