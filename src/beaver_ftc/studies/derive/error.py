"""What the terms leave of the angular accelerations: measured box by box, written as the aircraft's map."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.design.inertia import InertiaCoefficients, inertia_coefficients
from beaver_ftc.studies.derive.flown import places, sorted_in
from beaver_ftc.studies.derive.sample import AGES_S, REACHES, SHARES, Samples, flow_signals

MARGIN = 1.3  # of the declared error over the largest one found
LEAST_RAD_S2 = 1e-7  # beside rounding in the file


def errors_of(aircraft: Aircraft, samples: Samples) -> np.ndarray:
    """|f + G u - truth| of each sample, (n, 3) rad/s2."""
    of = flow_signals(samples, aircraft) | dict(zip(aircraft.surfaces, samples.u.T, strict=True))
    geometry = aircraft.geometry
    size = samples.y[:, 3] * geometry.wing_area_m2
    moments = [
        size * arm * aircraft.coefficient(name, of)
        for name, arm in zip(MOMENTS, (geometry.span_m, geometry.chord_m, geometry.span_m), strict=True)
    ]
    believed = accelerations(inertia_coefficients(aircraft.mass), samples.x, np.column_stack(moments))
    error: np.ndarray = np.abs(believed - samples.rate)
    return error


def accelerations(i: InertiaCoefficients, x: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Euler's equations: rates x (n, 3) rad/s and moments (n, 3) N m give rad/s2, (n, 3)."""
    (p, q, r), (L, M, N) = x.T, moments.T
    return np.column_stack(
        [
            i.Ppq * p * q + i.Pqr * q * r + i.Pl * L + i.Pn * N,
            i.Qpp * p * p + i.Qpr * p * r + i.Qrr * r * r + i.Qm * M,
            i.Rpq * p * q + i.Rqr * q * r + i.Rl * L + i.Rn * N,
        ]
    )


def largest(errors: np.ndarray, samples: Samples) -> np.ndarray:
    """The largest error within each age, box and share of the travel, (ages, boxes, shares, 3) rad/s2."""
    table = np.zeros((len(AGES_S), len(REACHES), len(SHARES), 3))
    for at in np.ndindex(table.shape[:3]):
        age, box, level = at
        inside = (samples.age <= age) & (samples.box <= box) & (samples.level <= level)
        table[at] = errors[inside].max(axis=0, initial=0.0)
    return table


def map_of(aircraft: Aircraft, sets: Sequence[Samples], flown: Samples) -> tuple[dict[str, Any], np.ndarray]:
    """The section `model_error_map` of the aircraft's file, and the largest error of each set, (sets, 3).

    sets: of random states, that make the boxes; flown: states of flights, of which those in a box count.
    """
    ends = [_ends(aircraft, sets, box) for box in range(len(REACHES))]
    sets = [*sets, sorted_in(flown, ends, aircraft, SHARES)]
    tables = np.array([largest(errors_of(aircraft, samples), samples) for samples in sets])
    table = MARGIN * tables.max(axis=0) + LEAST_RAD_S2
    boxes = [_box(aircraft, ends[box], table[:, box]) for box in range(len(REACHES))]
    return {"travel_share": list(SHARES), "until_s": list(AGES_S), "boxes": boxes}, tables[:, 0, -1, -1]


def _ends(aircraft: Aircraft, sets: Sequence[Samples], box: int) -> np.ndarray:
    """The least and the greatest of every quantity in a box, (2, 7 + declared), rounded outwards."""
    within = np.concatenate([places(samples, aircraft)[samples.box <= box] for samples in sets])
    low = [_rounded(float(v), -1) for v in within.min(axis=0)]
    return np.array([low, [_rounded(float(v), 1) for v in within.max(axis=0)]])


def _box(aircraft: Aircraft, ends: np.ndarray, errors: np.ndarray) -> dict[str, Any]:
    names = [*(f"{axis}_rad_s" for axis in AXES), "alpha_rad", "beta_rad", "airspeed_mps", "density_kg_m3"]
    ranges = [[float(low), float(high)] for low, high in ends.T]
    flow = dict(zip(names, ranges, strict=False))
    signals = dict(zip(aircraft.signals, ranges[len(names) :], strict=True))
    known = {
        f"error_{axis}_rad_s2": [[_rounded(float(e), 1) for e in of_age] for of_age in errors[:, :, i]]
        for i, axis in enumerate(AXES)
    }
    return flow | {"signals": signals} | known


def _rounded(value: float, way: int) -> float:
    """To a few digits, outwards."""
    if value == 0.0:
        return 0.0
    digit = 10.0 ** (np.floor(np.log10(abs(value))) - 4)
    return float(f"{(np.ceil(value / digit) if way > 0 else np.floor(value / digit)) * digit:.8g}")
