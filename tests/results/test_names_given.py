"""Names given in flight, held against the faults they name: early, late, one after the other, two at once."""

import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import Scenario as Given
from given import given
from trainer import TRAINER

GIVEN = given(__file__)

LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 4}
JAM = {"actuator": "rudder", "type": "stuck", "position_deg": 8, "at_s": 9}
ALL = {"fault_class": "all"}
NOISY = {"bounds": {"sensors": "tactical-grade"}}


@pytest.mark.parametrize(
    "keys",
    GIVEN["what a hint proposes can be flown"],
)
def test_what_a_hint_proposes_can_be_flown(keys):
    given = {"name": "x", "duration_s": 10, "faults": [LOSS, JAM], **keys}
    scenario = Given.model_validate(given, context={"folder": TRAINER.parent})
    flight = bf.fly(scenario.with_({"duration_s": 9.5}))
    (hint,) = [said for said in flight.metrics["hints"] if "several surfaces" in said]
    proposed = scenario.with_({"fdi.fault_class": "all"}) if scenario.fdi.is_ours else scenario
    if "; set fdi" in hint:
        bf.fly(proposed.with_({"fdi.pairs": True, "duration_s": 9.5}))
    else:
        assert "fdi.pairs, which looks for two, is" in hint
        with pytest.raises(BadInput, match="pairs"):
            proposed.with_({"fdi.pairs": True})
