"""The vehicle file: what it says, and one line for each mistake in it."""

import pytest
import yaml

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import synthetic


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("name: wing", "name: wing\ncolour: red", "wing.yaml:2: colour: unknown key"),
        ("p: p_rad_s, ", "", "wing.yaml:2: rates.p: required key is missing"),
        ("roll_command: 0.5, pitch_command: -0.5", "roll: 0.5", "surfaces.left.roll: 'roll' is no command"),
        ("roll_command: 0.5, pitch_command: -0.5", "roll_command: 0.0", "left: no command moves it, allowed"),
        (
            "[roll_command, ",
            "[roll_command, roll_command, ",
            "commands[1]: 'roll_command' stands twice, allowed",
        ),
        ("labels: {right", "labels: {wrong", "labels.wrong: 'wrong' is no surface"),
        ("0.5, pitch_command: -0.5", "much", "surfaces.left.roll_command: 'much' is text, allowed: a number"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, old, new, says):
    path = tmp_path / "wing.yaml"
    assert old in synthetic.VEHICLE
    path.write_text(synthetic.VEHICLE.replace(old, new))
    with pytest.raises(BadInput) as error:
        load_vehicle(path)
    assert says in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_name_that_is_not_built_in():
    with pytest.raises(BadInput, match="no such file or built-in vehicle, did you mean alfa"):
        load_vehicle("alpha")


PLACES = (
    "rates.p", "rates.q", "rates.r", "attitude.roll", "attitude.pitch", "attitude.yaw", "acceleration",
    "airspeed", "energy.altitude", "energy.airspeed", "flow.alpha_rad", "flow.beta_rad",
)  # fmt: skip


def test_a_unit_of_another_kind_is_refused_wherever_it_stands(tmp_path):
    keys = {"name": "all", "commands": ["u"], "surfaces": {"left": {"u": 1.0}}}
    for place in PLACES:
        at, _, key = place.partition(".")
        quantity = {"column": place, "unit": "%"}
        if key:
            keys.setdefault(at, {})[key] = quantity
        else:
            keys[at] = quantity
    (tmp_path / "all.yaml").write_text(yaml.safe_dump(keys))
    with pytest.raises(BadInput) as refused:
        load_vehicle(tmp_path / "all.yaml")
    lines = str(refused.value).splitlines()
    assert sorted(line.split(": ")[1] for line in lines) == sorted(f"{place}.unit" for place in PLACES)
    assert all("'%' is no unit of it" in line for line in lines)
