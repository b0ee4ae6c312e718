"""Prepare flights for a fit: the assumed law and air, and the effect of the airspeed.

V, V0       airspeed, m/s, and the airspeed at which a command has the effect of the model, m/s
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc_logs import orders
from beaver_ftc_logs.fit_parts import fit_parts
from beaver_ftc_logs.groups import group_surfaces
from beaver_ftc_logs.loading import have_labels
from beaver_ftc_logs.noise_search import whiten_flights
from beaver_ftc_logs.samples import Samples, scale_by_airspeed
from beaver_ftc_logs.vehicle import Vehicle
from beaver_ftc_logs.whitening import whiten_samples

# A model is decisively better if its information criterion is less by this: odds of 150 to 1 [Kass1995,
# section 3.2].
_DECISIVE_BIC = 10.0
# Powers of the airspeed that are tried for the effect of a surface, besides the square.
_AIRSPEED_POWERS = (0.0, 1.0, 3.0)


def assume_law_and_air(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Vehicle, list[str]]:
    """The vehicle with the keys `other_laws` and `moving_air` that its file leaves out, a line on each, and a
    line if there is no reference airspeed.

    Flights without labels show neither which law nor which air a later flight has, so both keys become true.
    An alarm then needs more evidence. If a flight has labels, later flights are assumed to be as these: both
    become false.
    """
    labelled = have_labels(flights)
    changes = {"other_laws": "other laws may fly", "moving_air": "the air may move"}
    lines = []
    for key, change in changes.items():
        stated = getattr(vehicle, key)
        if stated is not None:
            lines.append(f"{key}: {str(stated).lower()}, as the vehicle file says")
        elif labelled:
            lines.append(f"{key}: false, as fitted (labels show faults under it)")
        else:
            lines.append(f"{key}: true, {change} (logs of healthy flight do not tell)")
    if vehicle.reference_airspeed_mps is None:
        is_logged = any(np.isfinite(flight.airspeed).any() for flight in flights)
        reason = "explains no more" if is_logged else "is not logged"
        lines.append(f"reference_airspeed_mps: none, the airspeed {reason}")
    assumed = {key: not labelled for key in changes if getattr(vehicle, key) is None}
    return vehicle.model_copy(update=assumed), lines


def scale_if_better(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Sequence[Samples], Vehicle]:
    """The flights scaled with V / V0 (`scale_by_airspeed`, with the power 2), and the vehicle with V0, if
    this explains decisively more. Otherwise, and if the file states V0 or no airspeed is known, both as they
    are. Where other laws may fly, `_choose_powers` gives the powers. V0: median of the known airspeeds.
    """
    V = np.concatenate([flight.airspeed for flight in flights])
    V = V[np.isfinite(V)]
    V0 = float(np.median(V)) if V.size else 0.0
    if vehicle.reference_airspeed_mps is not None or V0 <= 0.0:
        return flights, vehicle
    assumed, _ = assume_law_and_air(flights, vehicle)
    best = assumed.model_copy(update={"reference_airspeed_mps": V0})
    if _min_bic(flights, assumed) - _min_bic(_scaled(flights, best), best) < _DECISIVE_BIC:
        return flights, vehicle
    if best.other_laws:
        best = _choose_powers(flights, best)
    scaling = {key: getattr(best, key) for key in ("reference_airspeed_mps", "airspeed_powers")}
    return _scaled(flights, best), vehicle.model_copy(update=scaling)


def _choose_powers(flights: Sequence[Samples], vehicle: Vehicle) -> Vehicle:
    """The vehicle in which each group of surfaces in turn takes the best of _AIRSPEED_POWERS if it explains
    decisively more than the power so far, with the powers that the groups before it have taken.

    white: the flights with the powers so far, in moving air whitened: the criterion counts every sample as
    independent, which holds for white noise only.
    """
    white = whiten_flights(_scaled(flights, vehicle), vehicle)

    def criterion(candidate: Vehicle) -> float:
        """The least criterion of the flights, scaled for a vehicle and whitened as `white`."""
        scaled = _scaled(flights, candidate)
        if candidate.moving_air:
            pairs = zip(scaled, white, strict=True)
            scaled = [whiten_samples(flight, w.noise_ma_coefficients, w.fit_weight) for flight, w in pairs]
        return _min_bic(scaled, candidate)

    lowest = criterion(vehicle)
    names = list(vehicle.surfaces)
    for group in group_surfaces(vehicle):
        candidates = {}
        for power in _AIRSPEED_POWERS:
            powers = vehicle.airspeed_powers | {names[i]: power for i in group}
            candidate = vehicle.model_copy(update={"airspeed_powers": powers})
            candidates[criterion(candidate)] = candidate
        if lowest - min(candidates) >= _DECISIVE_BIC:
            lowest = min(candidates)
            vehicle = candidates[lowest]
    return vehicle


def _scaled(flights: Sequence[Samples], vehicle: Vehicle) -> list[Samples]:
    """The flights by `scale_by_airspeed`, with the reference airspeed and the powers of the vehicle."""
    V0 = vehicle.reference_airspeed_mps or 0.0
    return [scale_by_airspeed(flight, V0, vehicle.surface_airspeed_powers) for flight in flights]


def _min_bic(flights: Sequence[Samples], vehicle: Vehicle) -> float:
    """The least Bayesian information criterion over all orders."""
    return min(orders.bic_by_order(fit_parts(flights), vehicle).values())
