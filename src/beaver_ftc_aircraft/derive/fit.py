"""A sparse table of terms for the moments, and the error that it leaves, box by box.

Orthogonal matching pursuit on what may be multiplied: the coefficients follow from the sampled accelerations
and the inertia by Euler's equations; each is then fitted alone. A term is taken for what it explains of the
residual, all taken so far are fitted again, and it ends when another would explain next to nothing; what
turned out to be no use is then left out again. What the terms leave of the angular accelerations is measured
box by box and written as the aircraft's map.
"""

from collections.abc import Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import lstsq

from beaver_ftc.aircraft import AXES, MOMENTS, Aircraft, MassProperties
from beaver_ftc.design import inertia_coefficients, inertial
from beaver_ftc.diagnosis.monitors import (
    THRUST_SIGNAL,
    YAW_SIGNAL,
    yaw_per_thrust,
)
from beaver_ftc.plant import ENGINE_SIGNALS
from beaver_ftc.studies.engine import Forks
from beaver_ftc_aircraft.derive.sample import (
    AGES_S,
    REACHES,
    USUAL,
    Moves,
    Samples,
    places,
    quantities,
    sorted_in,
)

MOST_TERMS = 26
LEAST_GAIN = 3e-3  # of what is left, for another term to be taken
EXACT = 1e-10  # share of the variance at which nothing is left: the turning Earth leaves as much
RIDGE = 1e-13  # keeps what is nearly the same twice from being nearly infinite
NO_USE = 1e-3  # of what is left in the end, for a term to stay
LEAST_RAD_S2 = 1e-3  # below it, how small an error is does not matter
MARGIN = 1.3  # of the declared error over the largest one found
LEAST_APART, MIRRORED = 1e-7, 1e-6  # of what engines do unlike, as a coefficient
ROUNDING_RAD_S2 = 1e-7  # of errors in the file
LEAST_SPAN = 1e-9  # of a signal over the samples, dimensionless
NOT_MISSED = 0.02  # rise of the sum of the logarithms of the errors without a signal
_FREE: tuple[dict[str, int], ...] = (
    {}, *({"alpha": power} for power in range(1, 6)), *({"beta": power} for power in range(1, 4)),
    {"alpha": 1, "beta": 1}, {"alpha": 2, "beta": 1}, {"alpha": 1, "beta": 2}, {"alpha": 1, "beta": 3},
    *({rate: 1} for rate in ("ph", "qh", "rh")),
    *({"alpha": power, rate: 1} for power, rate in product((1, 2), ("ph", "qh", "rh"))),
)  # fmt: skip
_WITH_SURFACE: tuple[dict[str, int], ...] = (
    {}, {"alpha": 1}, {"alpha": 2}, {"alpha": 3}, {"beta": 1}, {"beta": 2},
)  # fmt: skip
_OF_DECLARED: tuple[dict[str, int], ...] = (
    {}, {"alpha": 1}, {"alpha": 2}, {"beta": 1}, {"ph": 1}, {"qh": 1}, {"rh": 1},
)  # fmt: skip
EXACT_TERMS = dict(zip(MOMENTS, ENGINE_SIGNALS, strict=True))  # with 1, by their definition
PLAIN = ("alpha_rate", "beta_rate", *EXACT_TERMS.values())
ANY_MOMENT = 1.0  # more than engines have, as a coefficient
MATTERS_RAD_S2 = 1e-3  # what an engine's moment must do in flight to be worth a signal
Term = dict[str, Any]
Candidate = tuple[dict[str, int], str | None]


def moment_coefficients(samples: Samples, mass: MassProperties, aircraft: Aircraft) -> np.ndarray:
    """Cl, Cm, Cn of each sample, (n, 3)."""
    Ix, Iy, Iz, Jxz = mass.Ix_kg_m2, mass.Iy_kg_m2, mass.Iz_kg_m2, mass.Jxz_kg_m2
    inertia = np.array([[Ix, 0.0, -Jxz], [0.0, Iy, 0.0], [-Jxz, 0.0, Iz]])
    moments = samples.rate @ inertia + np.cross(samples.x, samples.x @ inertia)
    return moments / (samples.y[:, 3:4] * aircraft.geometry.wing_area_m2 * _arms(aircraft))


def _arms(aircraft: Aircraft) -> np.ndarray:
    """What Cl, Cm and Cn are made dimensionless with beside the wing area, (3,) m."""
    return np.array([aircraft.geometry.span_m, aircraft.geometry.chord_m, aircraft.geometry.span_m])


def candidates(signals: Sequence[str], surfaces: Sequence[str]) -> list[Candidate]:
    """What a term may multiply: powers of signals, and a surface or none.

    Rates of the flow and moments of the engines come in as they are: what feeds them back in powers or times
    a surface would make a law that inverts the model chase itself.
    """
    free, with_surface = list(_FREE), list(_WITH_SURFACE)
    for signal in signals:
        if signal in PLAIN:
            free += [{signal: 1}]
            continue
        free += [{**of, signal: 1} for of in _OF_DECLARED] + [{signal: 2}, {signal: 3}]
        with_surface += [{signal: 1}, {signal: 2}, {"alpha": 1, signal: 1}]
    return [(of, None) for of in free] + [(of, s) for s in surfaces for of in with_surface]


def regressors(samples: Samples, aircraft: Aircraft, products: Sequence[Candidate]) -> np.ndarray:
    """What each candidate multiplies, (n, candidates)."""
    of, columns = quantities(samples, aircraft), []
    for powers, surface in products:
        column = np.ones(len(samples)) if surface is None else of[surface]
        for signal, power in powers.items():
            column = column * of[signal] ** power
        columns.append(column)
    return np.column_stack(columns)


class Columns:
    """Columns of n rows, each scaled to length 1, and their products with each other."""

    def __init__(self, A: np.ndarray) -> None:
        length = np.linalg.norm(A, axis=0)
        self.A, self.scale = A, np.where(length > 0.0, length, np.inf)  # what is zero explains nothing
        self.unit = A / self.scale
        self.gram = self.unit.copy("K").T @ self.unit  # BLAS rounds otherwise where an array meets itself
        self.used = [k for k in range(A.shape[1]) if A[:, k].any()]


class Products:
    """Products of columns with each other and with b: all that a pursuit needs of n rows."""

    def __init__(self, columns: Columns, b: np.ndarray) -> None:
        self.gram, self.onto = columns.gram, columns.unit.T @ b
        self.total, self.square = float(np.sum((b - b.mean()) ** 2)) or 1.0, float(b @ b)

    def unexplained(self, taken: list[int]) -> float:
        """Sum of squares that these columns leave."""
        return max(self.square - float(self.solved(taken) @ self.onto[taken]), 0.0)

    def solved(self, taken: list[int]) -> np.ndarray:
        """Coefficients of these columns, each scaled to length 1."""
        block = self.gram[np.ix_(taken, taken)] + RIDGE * np.eye(len(taken))
        coefficients: np.ndarray = np.linalg.solve(block, self.onto[taken])
        return coefficients

    def pursued(self, within: Sequence[int], most: int = MOST_TERMS) -> list[int]:
        """The columns to take of some."""
        taken: list[int] = []
        left, residual = self.square, self.onto
        free = np.array(within)
        while len(taken) < min(most, len(free)) and left > EXACT * self.total:
            open_ = free[~np.isin(free, taken)]
            wider = [*taken, int(open_[np.argmax(np.abs(residual[open_]))])]
            then = self.unexplained(wider)
            if left - then < LEAST_GAIN * left:
                break
            taken, left = wider, then
            residual = self.onto - self.gram[:, taken] @ self.solved(taken)
        return self.of_use(taken, left + EXACT * self.total)

    def exchanged(self, taken: list[int], within: Sequence[int]) -> list[int]:
        """Columns in place of these with which less is left: a pursuit may take neighbours."""
        best, left = list(taken), self.unexplained(taken)
        for place in range(len(taken)):
            others = [[*best[:place], k, *best[place + 1 :]] for k in within if k not in best]
            tried = [self.unexplained(columns) for columns in others]
            if tried and min(tried) < (1.0 - LEAST_GAIN) * left:
                best, left = others[int(np.argmin(tried))], min(tried)
        return best

    def of_use(self, taken: list[int], left: float) -> list[int]:
        """Leave out, one after the other, the columns without which hardly more is left."""
        kept = list(taken)
        for column in taken:
            fewer = [k for k in kept if k != column]
            if fewer and self.unexplained(fewer) < (1.0 + NO_USE) * left:
                kept = fewer
        return kept


def pursue(columns: Columns, b: np.ndarray, most: int = MOST_TERMS) -> tuple[list[int], np.ndarray]:
    """The columns taken, and their coefficients."""
    products, A = Products(columns, b), columns.A
    taken = products.exchanged(products.pursued(columns.used, most), columns.used)
    taken = products.of_use(taken, products.unexplained(taken) + EXACT * products.total)
    scale = np.linalg.norm(A[:, taken], axis=0)
    return taken, lstsq(A[:, taken] / scale, b)[0] / scale if taken else np.empty(0)


def nearness(samples: Samples, regions: int, moves: Moves) -> np.ndarray:
    """How much samples count where terms need not hold alike everywhere, (n,): as one over what is expected
    to be left of them, which grows with the box and with the square of what surfaces do from neutral."""
    weight: np.ndarray = 1.0 / (
        np.array(REACHES)[samples.box // regions] * np.array(moves.shares)[samples.level] ** 2
    )
    return weight


def fitted(
    samples: Samples, aircraft: Aircraft, most: int = MOST_TERMS, weight: np.ndarray | None = None
) -> dict[str, list[Term]]:
    """The terms of Cl, Cm and Cn, as an aircraft file has them, with the signals the aircraft declares.

    weight: of each sample, (n,); left out: all alike.
    """
    known = candidates(tuple(aircraft.signals), aircraft.surfaces)
    A = regressors(samples, aircraft, known)
    C = moment_coefficients(samples, aircraft.mass, aircraft)
    w = np.ones(len(samples)) if weight is None else weight
    columns = Columns(A * w[:, None])
    exact = [engines in aircraft.signals for engines in EXACT_TERMS.values()]
    with Forks() as forks:
        for axis, engines in enumerate(EXACT_TERMS.values()):
            known_of = samples.signals[engines] if exact[axis] else 0.0
            forks.submit(partial(pursue, columns, w * (C[:, axis] - known_of), most))
        found = forks.results()
    terms: dict[str, list[Term]] = {}
    for axis, (name, engines) in enumerate(EXACT_TERMS.items()):
        coefficients = dict(zip(*found[axis], strict=True))
        if exact[axis]:
            linear = known.index(({engines: 1}, None))
            coefficients[linear] = coefficients.get(linear, 0.0) + 1.0
        terms[name] = [_term(name, *known[k], float(value)) for k, value in sorted(coefficients.items())]
    return terms


def engine_signals(held: Samples, flown: Samples, aircraft: Aircraft) -> list[str]:
    """The moments of the engines that change in flight, so that no state at which time stands still shows
    them; all of them where one is nothing there: such a propeller leaps as its governor moves."""
    effects = zip(EXACT_TERMS.values(), _accelerations(flown, aircraft), strict=True)
    moves = {name: effect * np.ptp(flown.signals[name]) for name, effect in effects if name in flown.signals}
    found = [name for name, moved in moves.items() if moved > MATTERS_RAD_S2]
    return found if all(held.signals[name].any() for name in found) else list(moves)


def signals_of_use(samples: Samples, aircraft: Aircraft, most: int, wanted: Sequence[str] = ()) -> list[str]:
    """The signals that terms want, at most so many: one after the other that is missed least is left out, but
    none of those wanted. What is rounding alone (the thrust of engines that do not run) is no signal."""
    known = candidates(tuple(samples.signals), aircraft.surfaces)
    A = regressors(samples, aircraft, known)
    C = moment_coefficients(samples, aircraft.mass, aircraft) * _accelerations(samples, aircraft)
    columns = Columns(A)
    products = [Products(columns, C[:, axis]) for axis in range(3)]

    def misses(signals: set[str]) -> float:
        within = [k for k, (of, _) in enumerate(known) if not (set(of) & set(samples.signals)) - signals]
        left = [(of.unexplained(of.pursued(within)) / len(A)) ** 0.5 for of in products]
        return float(np.sum(np.log(np.array(left) + LEAST_RAD_S2)))

    kept = {name for name, values in samples.signals.items() if np.ptp(values) > LEAST_SPAN} | set(wanted)
    now = misses(kept)
    while kept - set(wanted):
        without = {signal: misses(kept - {signal}) for signal in sorted(kept - set(wanted))}
        least = min(without, key=without.__getitem__)
        if len(kept) <= most and without[least] > now + NOT_MISSED:
            break
        kept, now = kept - {least}, without[least]
    return [signal for signal in samples.signals if signal in kept]


def _accelerations(samples: Samples, aircraft: Aircraft) -> np.ndarray:
    """What one unit of Cl, Cm and Cn does, rad/s2."""
    mass = aircraft.mass
    inertia = np.array([mass.Ix_kg_m2, mass.Iy_kg_m2, mass.Iz_kg_m2])
    size: np.ndarray = samples.y[:, 3].mean() * aircraft.geometry.wing_area_m2 * _arms(aircraft) / inertia
    return size


def _term(coefficient: str, of: dict[str, int], surface: str | None, value: float) -> Term:
    parts = [*([surface] if surface else []), *(f"{s}{p if p > 1 else ''}" for s, p in of.items())]
    term: Term = {"name": f"{coefficient}_{'_'.join(parts) or '0'}", "value": float(f"{value:.8g}"), "of": of}
    return term | ({"surface": surface} if surface else {})


def errors_of(aircraft: Aircraft, samples: Samples) -> np.ndarray:
    """|f + G u - truth| of each sample, (n, 3) rad/s2."""
    of, i = quantities(samples, aircraft), inertia_coefficients(aircraft.mass)
    size = samples.y[:, 3] * aircraft.geometry.wing_area_m2
    arms = zip(MOMENTS, _arms(aircraft), strict=True)
    L, M, N = (size * arm * aircraft.coefficient(name, of) for name, arm in arms)
    p, q, r = inertial(i, samples.x).T
    believed = np.column_stack([p + i.Pl * L + i.Pn * N, q + i.Qm * M, r + i.Rl * L + i.Rn * N])
    error: np.ndarray = np.abs(believed - samples.rate)
    return error


def within(samples: Samples, box: int, regions: int) -> np.ndarray:
    """Which samples are of a box or of one inside it, (n,); boxes of several regions take turns."""
    inside: np.ndarray = (samples.box <= box) & (samples.box % regions == box % regions)
    return inside


def largest(errors: np.ndarray, samples: Samples, regions: int = 1, moves: Moves = USUAL) -> np.ndarray:
    """The largest error within each age, box and share of the travel, (ages, boxes, shares, 3) rad/s2."""
    table = np.zeros((len(AGES_S), len(REACHES) * regions, len(moves.shares), 3))
    for age, box, level in np.ndindex(table.shape[:3]):
        inside = (samples.age <= age) & within(samples, box, regions) & (samples.level <= level)
        table[age, box, level] = errors[inside].max(axis=0, initial=0.0)
    return table


def map_of(
    aircraft: Aircraft, sets: Sequence[Samples], flown: Samples, regions: int = 1, moves: Moves = USUAL
) -> tuple[dict[str, Any], np.ndarray]:
    """The section `model_error_map` of the aircraft's file, and the largest error of each set, (sets, 3).

    sets: of random states, that make the boxes; flown: states of flights, of which those in a box count.
    """
    every = range(len(REACHES) * regions)
    ends = [_ends(aircraft, sets, box, regions) for box in every]
    sets = [*sets, sorted_in(flown, ends, aircraft, moves)]
    tables = np.array([largest(errors_of(aircraft, samples), samples, regions, moves) for samples in sets])
    table = MARGIN * tables.max(axis=0) + ROUNDING_RAD_S2
    boxes = [_box(aircraft, ends[box], table[:, box]) for box in every]
    of_all = tables[:, 0, -regions:, -1].max(axis=1)
    seldom = {"stand_ins": moves.stand_ins} if moves.stand_ins != 1.0 else {}
    return {"travel_share": list(moves.shares), **seldom, "until_s": list(AGES_S), "boxes": boxes}, of_all


def set_engines_apart(boxes: Sequence[dict[str, Any]], aircraft: Aircraft, alike: Samples) -> None:
    """Fill in how unlike engines pull in each box, if they are mirrored; alike: states with all their levers
    where one is. Of others nobody has measured what they do while levers move: a c310's alarmed."""
    of = alike.signals
    apart = np.abs(of[YAW_SIGNAL] - yaw_per_thrust(aircraft) * of[THRUST_SIGNAL])
    for i, box in enumerate(boxes if apart.max() < MIRRORED else ()):
        box["engines_apart"] = _rounded(MARGIN * float(apart[alike.box <= i].max()) + LEAST_APART, np.ceil)


def _ends(aircraft: Aircraft, sets: Sequence[Samples], box: int, regions: int) -> np.ndarray:
    """The least and the greatest of every quantity in a box, (2, 7 + declared), rounded outwards; anything of
    an engines' moment that no state shows: in the terms it stands by its definition alone."""
    there = [places(samples, aircraft)[within(samples, box, regions)] for samples in sets]
    inside = np.concatenate(there)
    low, high = inside.min(axis=0).tolist(), inside.max(axis=0).tolist()
    for k, name in enumerate(aircraft.signals, start=len(low) - len(aircraft.signals)):
        if name in EXACT_TERMS.values() and not any(of.signals[name].any() for of in sets):
            low[k], high[k] = -ANY_MOMENT, ANY_MOMENT
    return np.array([[_rounded(v, np.floor) for v in low], [_rounded(v, np.ceil) for v in high]])


def _box(aircraft: Aircraft, ends: np.ndarray, errors: np.ndarray) -> dict[str, Any]:
    names = [*(f"{axis}_rad_s" for axis in AXES), "alpha_rad", "beta_rad", "airspeed_mps", "density_kg_m3"]
    ranges = ends.T.tolist()
    flow = dict(zip(names, ranges, strict=False))
    signals = dict(zip(aircraft.signals, ranges[len(names) :], strict=True))
    known = {
        f"error_{axis}_rad_s2": [[_rounded(e, np.ceil) for e in row] for row in errors[:, :, i].tolist()]
        for i, axis in enumerate(AXES)
    }
    return flow | {"signals": signals} | known


def _rounded(value: float, whole: np.ufunc) -> float:
    """To a few digits, up or down as `whole` goes."""
    if value == 0.0:
        return 0.0
    digit = 10.0 ** (np.floor(np.log10(abs(value))) - 4)
    return float(f"{whole(value / digit) * digit:.8g}")
