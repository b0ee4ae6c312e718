"""From probabilities of hypotheses to rows: when a name stands, and which bounds hold."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import diagnose, posterior_rows
from beaver_ftc_logs.bank import UNKNOWN_OFFSET, build_bank
from products.logs import small


def test_a_surface_of_unknown_effect_is_named_once_its_command_moves():
    """The command of the right elevon has no number at first, moves, and has none again."""
    model = small.model(fitted={"commands": [], "rates": [], "tied": [1.0, 0.0]})
    samples = small.flight(model, 4, rates=np.zeros((4, 3)))
    samples.commands[:, 0] = np.nan, 0.1, 0.2, np.nan
    rows = replace(small.rows([(4, "left", [1.0, 0.5])]), t_s=samples.t_s)
    named = diagnose.finish_rows(samples, model, rows).isolated_surfaces
    assert named.tolist() == ["left", "left", "right+left", "right+left"]


SETTINGS = {"level_step": 0.25, "alarm": 0.5, "bounds": 0.8}
WING = small.model(settings=SETTINGS)


@pytest.mark.parametrize(("at_hz", "of_hz", "taken"), [
    (10.0, 8.0, True), (10.001, 8.0, False), (6.0, 8.0, True), (5.999, 8.0, False),
])  # fmt: skip
def test_a_log_may_be_a_quarter_off_the_rate(at_hz, of_hz, taken):
    samples, model = small.flight(WING, 20, dt_s=1.0 / at_hz), small.model(rate_hz=of_hz)
    if taken:
        assert diagnose.check_log_fits_model(samples, model) is None
        return
    with pytest.raises(BadInput, match=r"allowed: within 25% of the 8 Hz the model was identified at"):
        diagnose.check_log_fits_model(samples, model)


def posterior(bank, *shares):
    """A row each: {level of each group: probability}."""
    rows = np.zeros((len(shares), len(bank.hypothesis_kind)))
    for row, said in zip(rows, shares, strict=True):
        for levels, share in said.items():
            its = (bank.effectiveness == levels).all(axis=1) & (bank.hypothesis_kind != UNKNOWN_OFFSET)
            row[its.argmax()] = share
    return rows


def test_a_loss_of_surfaces_that_move_together_has_no_lower_bound():
    tail = small.model(small.TAIL, settings=SETTINGS)
    bank, samples = build_bank(tail), small.flight(tail, 1)
    found = posterior_rows.rows_of_posterior(samples, tail, bank, posterior(bank, {(0.5, 1.0): 1.0}))
    assert found.effectiveness_low[0, [0, 2]].tolist() == [0.0, 0.0]


SOUND, RIGHT, LEFT, BOTH = (1.0, 1.0), (0.5, 1.0), (1.0, 0.25), (0.5, 0.25)


def test_names_under_other_laws(monkeypatch):
    """Unknown until the evidence is four times the threshold; another name waits a second; one group."""
    settings = WING.settings.model_copy(update={"threshold": 2.0})
    other = {"name_evidence": 4.0, "rename_s": 1.0, "one_group": True}
    asks = settings.model_copy(update=other)
    model = WING.model_copy(update={"settings": asks})
    reach = round(WING.rate_hz)
    gained = np.concatenate([[1.0, 1.0, 5.0, 1.0], np.zeros(2 * reach + 2)])
    monkeypatch.setattr(posterior_rows, "fault_evidence", lambda posterior, bank: gained)
    shares = [{LEFT: 1.0}] * 4 + [{BOTH: 0.6, LEFT: 0.4}] + [{RIGHT: 0.6, SOUND: 0.4}] * (2 * reach + 1)
    bank = build_bank(model)

    def named_by(of):
        found = posterior_rows.rows_of_posterior(
            small.flight(of, len(shares)), of, bank, posterior(bank, *shares)
        )
        assert found.faulty.tolist() == [0] + [1] * (len(shares) - 1)
        return found.isolated_surfaces.tolist()

    assert named_by(model) == ["", "unknown", "unknown", *["left"] * (2 + reach), *["right"] * (reach + 1)]
    same = model.model_copy(update={"settings": settings})
    assert named_by(same) == ["", *["left"] * 3, "right+left", *["right"] * (2 * reach + 1)]
