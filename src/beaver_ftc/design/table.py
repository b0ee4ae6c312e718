"""The table of an aircraft's moment or force coefficients, and what is computed from it.

A term is a value times a monomial of dimensionless signals and, if it has a surface, times that
surface's deflection. The monomials form a chain: each is an earlier one times one signal, so it costs one
multiplication. From the same table come the sums without surfaces (f), the slopes per rad of each surface
(G), what each value multiplies, and the derivative of everything along a signal. A table holds three
coefficients, Cl, Cm, Cn or CX, CY, CZ; its terms are sorted by coefficient, of each first those without a
surface.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from beaver_ftc.aircraft import Aircraft, Term
from beaver_ftc.aircraft.schema import FLOW_SIGNALS, MAX_MONOMIALS, MAX_SIGNALS, MAX_TERMS
from beaver_ftc.compiled import fill, kernel, record

ALPHA, BETA, AIRSPEED, QDYN, DPT = range(5)  # places in y; declared signals begin at the last
N_Y = 4 + MAX_SIGNALS
N_SIGNALS = len(FLOW_SIGNALS) + MAX_SIGNALS
PH, QH, RH = (FLOW_SIGNALS.index(name) for name in ("ph", "qh", "rh"))
assert FLOW_SIGNALS[: PH + 3] == ("alpha", "beta", "ph", "qh", "rh")  # as in y, and the rates side by side
_DECLARED = len(FLOW_SIGNALS)  # where declared signals begin among the signals

TABLE = record(
    span=float, chord=float, n_declared=int,
    # monomial k is monomial parent[k] times signal factor[k]; monomial 0 is 1
    n_monomials=int, parent=("u8", MAX_MONOMIALS), factor=("u8", MAX_MONOMIALS),
    # of each coefficient the terms without a surface, and those with one
    n_terms=int, free_from=(int, 3), free_to=(int, 3), surface_to=(int, 3), value=MAX_TERMS,
    monomial=("u8", MAX_TERMS), surface=(int, MAX_TERMS),
    # scratch: signals and monomials of the state last evaluated
    signal=N_SIGNALS, power=MAX_MONOMIALS,
)  # fmt: skip


def fill_table(
    table: np.void,
    aircraft: Aircraft,
    terms: Sequence[Term],
    coefficients: Sequence[str],
    scale: Mapping[str, float] | None = None,
) -> None:
    """Write terms, sorted as `Aircraft.moments` are, into a record; `scale` multiplies single values."""
    scale = scale or {}
    place = aircraft.signal_names.index
    # the monomial of each term: the places of its signals, each once for each power, in ascending order
    needed = [tuple(sorted(place(name) for name, power in term.of for _ in range(power))) for term in terms]
    chain = _chain(needed)
    fill(
        table, span=aircraft.geometry.span_m, chord=aircraft.geometry.chord_m, n_terms=len(terms),
        n_declared=len(aircraft.signals), n_monomials=len(chain),
    )  # fmt: skip
    for k, monomial in enumerate(chain[1:], start=1):
        table["parent"][k], table["factor"][k] = chain.index(monomial[:-1]), monomial[-1]
    for k, (term, monomial) in enumerate(zip(terms, needed, strict=True)):
        table["value"][k] = term.value * scale.get(term.name, 1.0)
        table["monomial"][k] = chain.index(monomial)
        table["surface"][k] = aircraft.surfaces.index(term.surface) if term.surface else -1
    first = 0
    for i, coefficient in enumerate(coefficients):
        own_terms = [term for term in terms if term.coefficient == coefficient]
        table["free_from"][i] = first
        table["free_to"][i] = first + sum(term.surface is None for term in own_terms)
        first = table["surface_to"][i] = first + len(own_terms)


def _chain(wanted: Iterable[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """A chain of monomials that contains all wanted ones: the first is 1, and each other one is an earlier
    one with one more factor."""
    chain: list[tuple[int, ...]] = [()]
    for monomial in wanted:
        for length in range(1, len(monomial) + 1):
            if monomial[:length] not in chain:
                chain.append(monomial[:length])
    if len(chain) > MAX_MONOMIALS:
        raise ValueError(f"{len(chain)} monomials, allowed: at most {MAX_MONOMIALS}")
    return chain


@kernel
def signals(table, x, y, out):
    """Fill out (N_SIGNALS,): alpha, beta rad; ph = p b / 2V, qh = q c / V, rh = r b / 2V; the declared ones.
    x (3,) rad/s: p, q, r; y (4 + declared,); b, c m: span and chord."""
    V = y[AIRSPEED]
    out[ALPHA], out[BETA] = y[ALPHA], y[BETA]
    out[PH] = x[0] * table.span / (2 * V)
    out[QH] = x[1] * table.chord / V
    out[RH] = x[2] * table.span / (2 * V)
    for k in range(table.n_declared):
        out[_DECLARED + k] = y[DPT + k]


@kernel
def monomials(table, signal, out):
    """Fill out (MAX_MONOMIALS,) with the products of powers that the terms multiply."""
    parent, factor = table.parent, table.factor
    out[0] = 1.0
    for k in range(1, table.n_monomials):
        out[k] = out[parent[k]] * signal[factor[k]]


@kernel
def directional(table, signal, power, direction, out):
    """Fill out (MAX_MONOMIALS,) with the derivatives of the monomials `power` along a direction of the
    signals, (N_SIGNALS,)."""
    parent, factor = table.parent, table.factor
    out[0] = 0.0
    for k in range(1, table.n_monomials):
        out[k] = out[parent[k]] * signal[factor[k]] + power[parent[k]] * direction[factor[k]]


@kernel
def evaluate(table, x, y):
    """Bring the table's own signals and monomials to a state; x (3,) rad/s, y (4 + declared,)."""
    signals(table, x, y, table.signal)
    monomials(table, table.signal, table.power)


@kernel
def free_sum(table, i, power):
    """Coefficient i at neutral surfaces, from the monomials."""
    value, monomial = table.value, table.monomial
    # zero of the monomials' kind: real, complex, or an array of many states
    total = 0.0 * power[0]
    for k in range(table.free_from[i], table.free_to[i]):
        total += value[k] * power[monomial[k]]
    return total


@kernel
def surface_sums(table, power, out):
    """Fill out (3, surfaces) with each coefficient's slope per rad of each surface."""
    value, monomial, surface = table.value, table.monomial, table.surface
    for i in range(3):
        for s in range(out.shape[1]):
            out[i, s] = 0.0
        for k in range(table.free_to[i], table.surface_to[i]):
            out[i, surface[k]] += value[k] * power[monomial[k]]


@kernel
def whole_sum(table, i, power, u):
    """Coefficient i with surfaces at u (surfaces,) rad, from the monomials or their derivatives."""
    value, monomial, surface = table.value, table.monomial, table.surface
    total = free_sum(table, i, power)
    for k in range(table.free_to[i], table.surface_to[i]):
        total += value[k] * power[monomial[k]] * u[surface[k]]
    return total


@kernel
def regressors(table, power, u, out):
    """Fill out (MAX_TERMS,) with what each value multiplies, from the monomials; u (surfaces,) rad."""
    monomial, surface = table.monomial, table.surface
    for k in range(table.n_terms):
        out[k] = power[monomial[k]] * (u[surface[k]] if surface[k] >= 0 else 1.0)
