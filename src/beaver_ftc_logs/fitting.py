"""Fit: from recorded flights to a model with the settings of the filter that diagnoses later flights."""

from beaver_ftc.results import Document
from beaver_ftc_logs.fit_parts import Parts
from beaver_ftc_logs.gains import gain_overdispersion
from beaver_ftc_logs.model import FilterSettings, Model
from beaver_ftc_logs.noise_inflation import widen_noise
from beaver_ftc_logs.orders import bic_by_order, fitted_order
from beaver_ftc_logs.setting_estimates import estimate_trim_walk, labelled_faults, quick_error_share
from beaver_ftc_logs.vehicle import Vehicle

# Three tables of settings that healthy flights do not show, in the units of `FilterSettings`; then values of
# `power`, the information of a sample as a share of that of white noise. docs/results/choices.md has the
# flights on which each was chosen, and those on which it was judged.

# Labelled flights of other days: drift of trim and gains between days.
# trim_walk: the drift, in one flight, of the means of the residual over 30 s.
_OTHER_DAYS: Document = {
    "trim_sd": 0.1,  # residual sd
    "trim_shift": 0.03,  # share of travel
    "trim_walk": [2.5e-3, 6e-4, 2e-3],  # residual sd a sample; p, q, r
    "gain_sd": 0.1,
    "gain_time_s": 300.0,
    "own_gain_sd": 0.03,
}
# Flights under other laws. A law reacts to motion that the model does not explain, so the commands depend on
# this motion. The gain of each group then varies more, and a name needs more evidence. bounds: for a second
# or two after a loss most of the posterior mass still claims health. A mass of 0.9 held the truth at the
# fault in 0.70 to 0.94 of the samples, fewest of large losses; 0.97 in 0.83 to 0.99.
_OTHER_LAWS: Document = {
    "own_gain_sd": 0.05,
    "own_gain_time_s": 20.0,
    "name_evidence": 2.0,  # times the threshold of the alarm
    "rename_s": 1.0,
    "one_group": True,
    "bounds": 0.97,
}
# Flights under other laws in moving air: the settings that differ from `_OTHER_LAWS`.
_MOVING_AIR: Document = {"own_gain_sd": 0.08, "own_gain_time_s": 100.0}
# `power` of labelled flights: their residual is coloured.
_POWER_LABELLED = 0.8
# Largest `power` without labels under the law of the fit: nothing shows how often faults occur, so an alarm
# needs more evidence.
_POWER_UNLABELLED = 0.9
# Largest `power` under other laws: a law may feed the noise of a gyro to the surfaces, which doubles the
# residual.
_POWER_OTHER_LAWS = 0.4
# Delays that the commands of a flight may have beside that of the model, in samples.
_DELAYS_SAMPLES = (-0.4, 0.0, 0.4)


def fit_model(parts: Parts, vehicle: Vehicle, settings: FilterSettings | None = None) -> Model:
    """The model that fits these flights. Raises BadInput if they have too few samples."""
    bic = bic_by_order(parts, vehicle)
    _, model = fitted_order(parts, vehicle, *min(bic, key=bic.__getitem__))
    model = model.model_copy(update={"settings": settings or estimate_filter_settings(parts, model)})
    return widen_noise(parts, model) if model.colours else model


def estimate_filter_settings(parts: Parts, model: Model) -> FilterSettings:
    """The settings of the filter for later flights. Of two rows that give one setting, the lower one decides.

        if                           settings                                          power
        labels show a fault          _OTHER_DAYS                                       _POWER_LABELLED
        moving air / still           no extra delay / _DELAYS_SAMPLES
        other laws may fly           _OTHER_LAWS
            in moving air            _MOVING_AIR
            noise models are fitted  quick_error, of parts left out
        labels show a fault          levels, changes_per_hour, repair_share            as above
        no label shows one           trim_walk, of parts left out                      min(limit, 1 / s)

    s: overdispersion of the gains in parts left out, with the settings of all these rows. limit:
    _POWER_UNLABELLED; if other laws may fly, _POWER_OTHER_LAWS in still air and 1 in moving air.
    """
    vehicle = model.vehicle
    moving = vehicle.moving_air
    settings: Document = {"delays_s": [0.0] if moving else [d / model.rate_hz for d in _DELAYS_SAMPLES]}
    if vehicle.other_laws:
        settings |= _OTHER_LAWS | (_MOVING_AIR if moving else {})
        if model.colours:
            settings["quick_error"] = quick_error_share(parts, model)
    if labelled := labelled_faults(parts, model):
        return FilterSettings(**(_OTHER_DAYS | settings | labelled), power=_POWER_LABELLED)
    limit = _POWER_UNLABELLED
    if vehicle.other_laws:
        limit = 1.0 if moving else _POWER_OTHER_LAWS
    settings["trim_walk"] = estimate_trim_walk(parts, model)
    drifting = model.model_copy(update={"settings": FilterSettings(**settings)})
    return FilterSettings(**settings, power=min(limit, 1.0 / gain_overdispersion(parts, drifting)))
