"""What a vehicle file and a model file may say: every key with its limits and its default."""

import json

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.model import Model, load_model, model_file_text
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle
from kept import keys_of
from products.logs import small


@pytest.mark.parametrize("of", [Model, Vehicle])
def test_what_a_file_may_say(changed, of):
    assert not changed(keys_of(of.model_json_schema()))


def test_a_model_comes_back_from_its_file(tmp_path):
    model = small.model(settings={"levels": {"left": [0.4]}}, identified={"tests": [1, {"a": None}]})
    path = tmp_path / "model.json"
    path.write_text(model_file_text(model))
    assert load_model(path) == model


@pytest.mark.parametrize(("load", "most"), [(load_model, 20_000_000), (load_vehicle, 1_000_000)])
def test_a_file_larger_than_any_is_refused(tmp_path, load, most):
    """Just so large it is read, and found to lack what it should have."""
    path = tmp_path / "large.yaml"
    text = json.dumps({"name": "wing"})
    for size, says in ((most + 1, "allowed: at most"), (most, "required key is missing")):
        path.write_text(text + " " * (size - len(text)))
        with pytest.raises(BadInput, match=says):
            load(path)
