"""From probabilities of hypotheses to rows: each step by hand, and the whole as it was kept."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import diagnose
from beaver_ftc_logs.bank import NO_RESPONSE, UNKNOWN_OFFSET, build_bank
from products.logs import small

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


@pytest.mark.parametrize(("hold_s", "stands"), [
    (0.0, [0, 1, 1, 1, 1, 0, 1, 0]), (0.1, [0, 0, 1, 1, 1, 0, 0, 0]), (0.2, [0, 0, 0, 1, 1, 0, 0, 0]),
    (0.26, [0, 0, 0, 0, 1, 0, 0, 0]), (0.4, [0, 0, 0, 0, 0, 0, 0, 0]),
])  # fmt: skip
def test_a_condition_stands_once_it_has_held(hold_s, stands):
    model = small.model(settings={"hold_s": hold_s})
    raised = np.array([0, 1, 1, 1, 1, 0, 1, 0], dtype=bool)
    assert diagnose._held_long_enough(raised, model).astype(int).tolist() == stands
    assert diagnose._held_long_enough(raised[1:], model).astype(int).tolist() == stands[1:]


LEVELS = np.array([0.0, 0.25, 0.5, 1.0])


@pytest.mark.parametrize(("mass", "bounds"), [
    ([0.0, 0.9, 0.1, 0.0], (0.125, 0.375)),
    ([0.1, 0.5, 0.4, 0.0], (0.125, 0.75)),  # two hold it: half a step more each way
    ([0.8, 0.1, 0.1, 0.0], (0.0, 0.125)),  # just so much is enough
    ([0.79, 0.01, 0.0, 0.2], (0.0, 1.0)),
    ([0.1, 0.0, 0.0, 0.9], (0.75, 1.0)),
    ([0.3, 0.3, 0.3, 0.1], (0.0, 0.75)),
    ([0.4, 0.0, 0.5, 0.1], (0.0, 0.75)),  # what lies between is inside
])  # fmt: skip
def test_bounds_are_of_the_fewest_levels_that_hold_the_share(mass, bounds):
    low, high = diagnose._credible_bounds(LEVELS, np.array([mass]), 0.8)
    assert (low[0], high[0]) == bounds


def posterior(bank, *shares):
    """A row each: {what: probability}, what being `idle`, `unknown` or (level of each group)."""
    rows = np.zeros((len(shares), len(bank.hypothesis_kind)))
    for row, said in zip(rows, shares, strict=True):
        for what, share in said.items():
            if isinstance(what, str):
                row[
                    (bank.hypothesis_kind == {"idle": NO_RESPONSE, "unknown": UNKNOWN_OFFSET}[what]).argmax()
                ] = share
                continue
            row[
                ((bank.effectiveness == what).all(axis=1) & (bank.hypothesis_kind != UNKNOWN_OFFSET)).argmax()
            ] = share
    return rows


SOUND, RIGHT, LEFT, BOTH = (1.0, 1.0), (0.5, 1.0), (1.0, 0.25), (0.5, 0.25)


@pytest.mark.parametrize("threshold", [None, 4.0])
def test_evidence_began_where_its_sum_was_last_at_zero(monkeypatch, threshold):
    """However high it may rise; in the first row where it never was."""
    model = small.model(settings=SETTINGS | {"threshold": threshold})
    gained = np.array([1.0, 2.0, -9.0, 2.0, 5.0, -6.0, 1.0, -3.0, -1.0, 2.0])
    monkeypatch.setattr(diagnose, "fault_evidence", lambda of, by: gained)
    bank = build_bank(model)
    samples = small.flight(model, 10, t_s=7.0 + 0.25 * np.arange(10))
    found = diagnose.rows_of_posterior(samples, model, bank, posterior(bank, *[{SOUND: 1.0}] * 10))
    # sums 1 3 0 2 7 1 2 0 0 2, and 1 3 0 2 4 0 1 0 0 2 where 4 is the most
    since = [0, 0, 2, 2, 2, 2, 2, 7, 8, 8] if threshold is None else [0, 0, 2, 2, 2, 5, 5, 7, 8, 8]
    assert found.evidence_start_time_s.tolist() == samples.t_s[since].tolist()
