"""The isolability statement against flights: what it says would show shows, and what would not does not."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs.bank import build_bank
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.identification import identify
from beaver_ftc_logs.isolability import isolability_document, isolability_sentences
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import synthetic

SLAVED = synthetic.VEHICLE.replace("pitch_command: 0.5}, left", "pitch_command: 0.0}, left").replace(
    "pitch_command: -0.5", "pitch_command: 0.0"
)


def test_surfaces_that_move_together_are_said_to_and_named_together(sampled, wing_folder):
    """Two surfaces on one command: a loss in either gives the same rates, so both are named."""
    (wing_folder / "slaved.yaml").write_text(SLAVED + "\nother_laws: false\nmoving_air: false\n")
    slaved = load_vehicle(wing_folder / "slaved.yaml")
    healthy = synthetic.fly(300.0, seed=61)
    del healthy["right_effectiveness"], healthy["left_effectiveness"]
    model = identify([sampled(columns=healthy, of=slaved)], slaved)
    assert model.groups == [["right", "left"]]
    named = []
    for part in ((80, 160, 0.2, 1.0), (80, 160, 1.0, 0.2)):
        samples = sampled(160.0, of=slaved, parts=(part,), seed=62)
        assert isolability_document(samples, model)["together"][0]["surfaces"] == ["right", "left"]
        rows = diagnose(samples, model)
        named.append(set(rows.isolated_surfaces[rows.faulty == 1]) - {"unknown"})
        suspected = rows.faulty == 1
        assert (rows.effectiveness_low[suspected] == 0.0).mean() > 0.9
    assert named[0] == named[1] == {"right+left"}


@pytest.mark.parametrize(("sign", "named"), [(1.0, "1.00"), (-1.0, "-1.00")])
def test_groups_that_act_alike_or_opposed_are_not_separable(sampled, wing_model, sign, named):
    """The left elevon's response made that of the right one, or its opposite, under the same commands."""
    samples = sampled(40.0, seed=47)
    right = np.array(wing_model.response[0])
    model = wing_model.model_copy(update={"response": [right.tolist(), (sign * right).tolist()]})
    moved = replace(samples, commands=samples.commands[:, [0, 0]])
    found = isolability_document(moved, model)
    (pair,) = found["alike"]
    assert pair["separable"] is False
    assert pair["cosine"] == pytest.approx(sign)
    assert (
        f"nearly proportional (cosine {named}): one may be named for the other."
        in isolability_sentences(found)[-1]
    )
    assert isolability_document(samples, wing_model)["alike"][0]["separable"] is True


def test_the_smallest_loss_by_its_closed_form(sampled, wing_model):
    """d^2 / 2 times the information gathered equals the odds, sample by sample from the model file; the same
    samples taken for half as long each carry twice as much a second. An alarm by a threshold also needs a
    fault that is likelier than health."""
    samples = sampled(40.0, seed=46)
    inverse = np.linalg.inv(np.array(wing_model.noise))
    response, lags = np.array(wing_model.response), wing_model.lags
    first = max(lags, wing_model.history)
    information = []
    for k in range(first, len(samples.t_s)):
        moved = samples.commands[k - lags : k, 0][::-1] @ response[0]
        information.append(moved @ inverse @ moved)
    bank = build_bank(wing_model)
    share = np.median(bank.transition_share[bank.is_fault_of_group(0)])
    faults = bank.transition_share[bank.is_fault_hypothesis].sum()
    for rate_hz, threshold in ((10.0, None), (20.0, None), (10.0, 30.0), (10.0, 1.0)):
        settings = wing_model.settings.model_copy(update={"threshold": threshold})
        model = wing_model.model_copy(update={"settings": settings})
        found = isolability_document(replace(samples, dt_s=1.0 / rate_hz), model)["groups"][0]
        per_s = settings.power * np.mean(information) * rate_hz
        assert found["information_per_s"] == pytest.approx(per_s, rel=1e-9)
        likelier = -np.log(settings.changes_per_hour / 3600.0 / rate_hz * share)
        odds = likelier if threshold != 30.0 else 30.0 - np.log(share / faults)
        assert 0.5 * found["smallest_loss"]["60"] ** 2 * per_s * 60.0 == pytest.approx(odds, rel=1e-9)
