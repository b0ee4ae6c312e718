"""Diagnose a recorded flight with an identified model: alarm, faulty surfaces and effectiveness by sample.

A row uses only samples up to its own time, but for the checks that refuse a whole log. `posterior_rows` makes
the rows from the probabilities of the hypotheses. Here the log is checked before, and names and bounds are
withdrawn where they are not credible.
"""

from dataclasses import replace
from itertools import compress

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import column_mistakes, energy, trust
from beaver_ftc_logs.bank import build_bank
from beaver_ftc_logs.groups import expand_groups
from beaver_ftc_logs.log_rows import LogRows, at_log_stamps
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.motion_units import refuse_rate_unit
from beaver_ftc_logs.posterior import bank_posterior
from beaver_ftc_logs.posterior_rows import NO_RESPONSE_LIMIT, rows_of_posterior
from beaver_ftc_logs.recording import Mask
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.samples import Samples

_LOG_RATE_TOLERANCE = 0.25  # largest relative difference between the sample rate of a log and of the model
# Largest motion of a command, a share of travel, that may be rounding.
_COMMAND_ROUNDING = 1e-6


def diagnose(samples: Samples, model: Model) -> LogRows:
    """The diagnosis of each sample. Raises BadInput where the log's rate, columns or units are not those of
    the model, or where a credible alarm vanishes if the command of a group has the other sign."""
    check_log_fits_model(samples, model)
    rows = _diagnose_checked_log(samples, model)
    if rows.has_credible_alarm():
        for group in column_mistakes.find_reversed(samples, model):
            signs = [-1.0 if surface in group else 1.0 for surface in model.vehicle.surfaces]
            corrected = _diagnose_checked_log(replace(samples, commands=samples.commands * signs), model)
            if corrected.clears_alarm(rows):
                raise reversed_command_error(samples.name, "+".join(group), "in the flights of the model")
    return rows


def reversed_command_error(flight: str, surface: str, allowed: str) -> BadInput:
    """The error for a log that raises an alarm, and none if the command of a surface has the other sign."""
    return BadInput(
        f"{flight}: if the command of {surface} has the other sign, there is no alarm, allowed: "
        f"signs as {allowed}; does `scale: -1` fit?"
    )


def _diagnose_checked_log(samples: Samples, model: Model) -> LogRows:
    """The rows of a flight whose columns fit the model. P (n, H): probabilities of the hypotheses, of which
    the last is that nothing answers the commands; silent (n,): where this is likely."""
    bank = build_bank(model)
    P = bank_posterior(trust.without_dead_rows(samples, model), model, bank)
    silent = P[:, -1] > NO_RESPONSE_LIMIT
    return finish_rows(samples, model, rows_of_posterior(samples, model, bank, P), silent)


def finish_rows(samples: Samples, model: Model, rows: LogRows, silent: Mask | None = None) -> LogRows:
    """Rows at the log's own stamps, without a verdict where the model is not credible, and without an
    estimate for a group whose gain is unknown (`trust.known_gains`). silent (n,): where nothing answers the
    commands."""
    reasons = trust.untrusted_rows(samples, model)
    if silent is not None:
        reasons["nothing answers the commands: on the ground, or these are not what it follows"] = silent
    nothing_known = np.full(len(rows.t_s), not trust.known_effects(model).any())
    reasons["of no surface is the effect known from the flights fitted"] = nothing_known
    rows = _add_unknown_surfaces(samples, model, _withdraw_by_engine(samples, model, rows))
    gain_known = trust.known_gains(model)[None]
    unknown = np.broadcast_to(expand_groups(gain_known, model) == 0.0, rows.effectiveness_low.shape)
    return at_log_stamps(samples, rows.without_estimate(unknown).without_verdict(reasons))


def _add_unknown_surfaces(samples: Samples, model: Model, rows: LogRows) -> LogRows:
    """Rows whose name also has each surface of unknown effect, since it may be at fault instead of the
    isolated one. If one is added, or if a name has several groups with `one_group`, any of these surfaces may
    be healthy: the upper bound of each is 1. The names `unknown` and `engine` stay.

    A loss of effectiveness shows only while the command moves: a surface whose command has not moved so far
    is not added. If surfaces can be stuck, any is added.
    """
    surfaces = list(model.vehicle.surfaces)
    u = samples.commands  # a missing number is passed over
    moved = np.fmax.accumulate(u) - np.fmin.accumulate(u) > _COMMAND_ROUNDING
    moved |= "stuck" in model.vehicle.faults
    unknown = trust.unknown_surfaces(model)
    addable = moved & np.isin(surfaces, list(unknown))
    names = rows.isolated_surfaces.copy()
    high = rows.effectiveness_high.copy()
    for k in np.flatnonzero(rows.faulty == 1):
        named = set(str(names[k]).split("+"))
        if not named <= set(surfaces):
            continue
        in_name = np.isin(surfaces, list(named)) | addable[k]
        names[k] = "+".join(compress(surfaces, in_name))
        of_one_group = any(named <= set(group) for group in model.groups)
        if in_name.sum() > len(named) or (model.settings.one_group and not of_one_group):
            high[k, in_name] = 1.0
    return replace(rows, isolated_surfaces=names, effectiveness_high=high)


def _withdraw_by_engine(samples: Samples, model: Model, rows: LogRows) -> LogRows:
    """Rows that name no surface while the energy height, if it is known, shows a possible engine failure."""
    unpowered_mps = model.fitted.energy_climb
    rate_mps = samples.energy_height_rate_mps
    if unpowered_mps is None or not np.isfinite(rate_mps).any():
        return rows
    named = energy.withdraw_surfaces(
        rows.t_s, rows.faulty, rows.isolated_surfaces, rate_mps, unpowered_mps, rows.evidence_start_time_s
    )
    return replace(rows.without_estimate(named != rows.isolated_surfaces), isolated_surfaces=named)


def check_log_fits_model(samples: Samples, model: Model) -> None:
    """Raise BadInput if the sample rate, the units or the columns of a log are not those of the model."""
    rate_hz = 1.0 / samples.dt_s
    if abs(rate_hz / model.rate_hz - 1.0) > _LOG_RATE_TOLERANCE:
        raise refusal(
            samples.name,
            f"has samples at {rate_hz:.3g} Hz",
            f"within {_LOG_RATE_TOLERANCE:.0%} of the {model.rate_hz:.3g} Hz the model was identified at",
        )
    refuse_rate_unit(samples, model.fitted)
    column_mistakes.refuse_columns(trust.without_dead_rows(samples, model), model)
