"""Mass, centre of gravity and inertia of each case, and the small masses that make JSBSim have them.

JSBSim keeps the empty weight, its place and its inertia as loaded; weights of point masses may be written in
flight, and be negative. Ten of them at fixed places have any mass, moment and inertia between them: what a
case needs is a system of ten linear equations.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from beaver_ftc.aircraft import M_PER_FT
from beaver_ftc_aircraft.gtm.elements import table, triple
from beaver_ftc_aircraft.gtm.parameters import DAMAGE_CASE, cases, parameters

LBS_PER_SLUG = 32.174049  # JSBSim's own
FIRST = 7  # of the masses; those before it are a scenario's mass and inertia errors
_PLACES = np.array(
    [
        [0, 0, 0],
        [1, 0, 0],
        [-1, 0, 0],
        [0, 1, 0],
        [0, -1, 0],
        [0, 0, 1],
        [0, 0, -1],
        [1, 1, 0],
        [1, 0, 1],
        [0, 1, 1],
    ],
    dtype=float,
)  # ft from the whole aircraft's centre of gravity
_PRODUCTS = ("xy", "xz", "yz")


@dataclass(frozen=True)
class Mass:
    """weight_lbf; cg_ft (3,), x forward, y right, z down; inertia (3, 3) slug ft2 about it."""

    weight_lbf: float
    cg_ft: np.ndarray
    inertia: np.ndarray


def _matrix(of: dict[str, float]) -> np.ndarray:
    """A tensor of moments and products of inertia."""
    found = np.diag([of.get(name, 0.0) for name in ("xx", "yy", "zz")])
    for name in _PRODUCTS:
        i, j = ("xyz".index(axis) for axis in name)
        found[i, j] = found[j, i] = -of.get(name, 0.0)
    return found


def mass_of(case: int = 0, gear_down: bool = False) -> Mass:
    """What a case leaves of the aircraft. The moment of the whole one is divided by the weight that is left,
    though the case's own shift is added: so the source has it."""
    of = parameters()["mass"]
    weight, cg = of["weight_lbf"], np.array(of["cg_ft"])
    inertia = _matrix(of["inertia"]) + _matrix(of["at_zero_burn"])
    left, shift = weight, np.zeros(3)
    if case:
        damage = list(cases().values())[case - 1]
        left, shift = weight + damage["dweight_lbf"], np.array(damage["dcg_in"]) / 12.0
        inertia = inertia + _matrix(damage["inertia"])
    if gear_down:
        shift, inertia = shift + np.array(of["gear"]["cg_ft"]), inertia + _matrix(of["gear"]["inertia"])
    return Mass(left, weight * cg / left + shift, inertia)


def structural_in(point_ft: np.ndarray | list[float]) -> np.ndarray:
    """A place in JSBSim's structural frame, x aft, y right, z up, inches."""
    return np.asarray(point_ft) * [-12.0, 12.0, -12.0]


def _about(point: np.ndarray) -> np.ndarray:
    """Inertia of a unit mass at a place."""
    return np.asarray((point @ point) * np.eye(3) - np.outer(point, point))


def _rows(weight_lbf: float, moment: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    return np.array([weight_lbf, *moment, *inertia[np.triu_indices(3)] * LBS_PER_SLUG])


def small_masses_lbf(case: int, gear_down: bool) -> np.ndarray:
    """The weights (10,) that turn the whole aircraft into what a case leaves."""
    whole, wanted = mass_of(), mass_of(case, gear_down)
    places = whole.cg_ft + _PLACES
    unit = [_rows(1.0, place, _about(place - wanted.cg_ft) / LBS_PER_SLUG) for place in places]
    have = whole.inertia + whole.weight_lbf / LBS_PER_SLUG * _about(whole.cg_ft - wanted.cg_ft)
    lack = _rows(
        wanted.weight_lbf - whole.weight_lbf,
        wanted.weight_lbf * wanted.cg_ft - whole.weight_lbf * whole.cg_ft,
        wanted.inertia - have,
    )
    return np.linalg.solve(np.array(unit).T, lack)


@lru_cache(maxsize=1)
def weights_by_case() -> dict[int, str]:
    """The weight of each small mass as a table of case and gear, by its number among all point masses."""
    numbers = range(len(cases()) + 1)
    found = np.array([[small_masses_lbf(case, down) for down in (False, True)] for case in numbers])
    found[0, 0] = 0.0
    keys = [(DAMAGE_CASE, np.arange(float(len(numbers)))), ("gear/mass-down", np.array([0.0, 1.0]))]
    return {FIRST + i: table(found[:, :, i], keys) for i in range(len(_PLACES))}


def mass_balance() -> str:
    """The element of the model: the whole aircraft, and the places of small masses."""
    whole = mass_of()
    in_ = structural_in(whole.cg_ft)
    inertia = whole.inertia
    # "false" keeps the signs of a tensor of integrals; x and z are turned in the structural frame, y is not
    entries = {
        "ixx": inertia[0, 0], "iyy": inertia[1, 1], "izz": inertia[2, 2],
        "ixy": inertia[0, 1], "ixz": -inertia[0, 2], "iyz": inertia[1, 2],
    }  # fmt: skip
    parts = [f'<{name} unit="SLUG*FT2">{float(number)!r}</{name}>' for name, number in entries.items()]
    parts.append(f'<emptywt unit="LBS">{whole.weight_lbf!r}</emptywt>')
    parts.append(f'<location name="CG" unit="IN">{triple(in_)}</location>')
    names = ("mass", "fore", "aft", "right", "left", "up", "down")
    metre = [np.zeros(3), *(sign * np.eye(3)[axis] for axis, sign in product(range(3), (1, -1)))]
    for name, way in zip(names, metre, strict=True):
        place = whole.cg_ft + way / M_PER_FT
        parts.append(_point(name, place))
    for i, way in enumerate(_PLACES):
        parts.append(_point(f"damage {i}", whole.cg_ft + way))
    return f'<mass_balance negated_crossproduct_inertia="false">{"".join(parts)}</mass_balance>'


def _point(name: str, place_ft: np.ndarray) -> str:
    at = triple(structural_in(place_ft))
    weight = '<weight unit="LBS">0</weight>'
    return f'<pointmass name="{name}">{weight}<location unit="IN">{at}</location></pointmass>'
