"""An aircraft of 17 surfaces flies, is diagnosed and is shown, as one of four."""

import pytest
import yaml
from tests import seventeen

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.scenario.schema import load_text

AILERONS = {"aileron_right_0", "aileron_right_1", "aileron_right_2"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("aircraft")
    seventeen.write(folder)
    return folder


def scenario(folder, **given):
    sine = {"amplitude_deg_s": 3, "frequency_hz": 0.25}
    file = folder / "flight.yaml"
    document = {
        "name": "flight",
        "aircraft": f"./{seventeen.NAME}",
        "duration_s": 4,
        "reference": {"p": [{"sine": sine}], "q": [{"sine": sine}]},
        **given,
    }
    file.write_text(yaml.safe_dump(document), encoding="utf-8")
    return bf.load(file)


def test_a_healthy_flight_raises_no_alarm_and_ends_in_no_departure(folder):
    flight = bf.fly(scenario(folder, fdi={"fault_class": "all"}))
    assert not flight.metrics["false_alarm"]
    assert flight.metrics["departure"] is None
    assert {f"{surface}_cmd_rad" for surface in load(f"./{seventeen.NAME}", folder).surfaces} <= {*flight.log}


def test_a_runaway_on_one_side_leaves_the_ailerons_of_that_side(folder):
    """They move the rates alike, and pitch with the other sign than those of the other side."""
    fault = {"actuator": "aileron_right_1", "type": "hardover", "direction": 1, "at_s": 1}
    flight = bf.fly(scenario(folder, fdi={"fault_class": "all"}, faults=[fault]))
    left = {candidate.partition(":")[0] for candidate in flight.metrics["isolation"]["candidates"]}
    assert left == AILERONS


def test_two_surfaces_lost_at_once_are_found_by_the_law_itself():
    """No single fault explains two lost ailerons: the law listens which surfaces answer, and asks those."""
    sines = {
        axis: [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.2 + 0.1 * i}}]
        for i, axis in enumerate("pqr")
    }
    lost = [
        {"type": "loss_of_effectiveness", "actuator": f"aileron_{side}", "magnitude": magnitude, "at_s": 3}
        for side, magnitude in (("left", 1.0), ("right", 0.7))
    ]
    given = {"name": "both", "aircraft": "beaver-split", "duration_s": 8, "reference": sines, "faults": lost}
    flight = bf.fly(load_text(yaml.safe_dump(given)))
    used = {
        name: flight.log[f"{name}_effectiveness_used"].iloc[-1] for name in flight.scenario.airframe.surfaces
    }
    assert flight.metrics["isolation"]["fault"] == "unanticipated"
    assert {name for name, share in used.items() if share < 0.4} == {"aileron_left", "aileron_right"}
    assert min(share for name, share in used.items() if "aileron" not in name) > 0.9
