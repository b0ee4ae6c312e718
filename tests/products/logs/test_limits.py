"""What a vehicle file and a model file may say: every key with its limits and its default."""

import json

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.model import Model, load_model, model_file_text
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle
from products.logs import small

LIMITS = (
    "minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum", "minLength", "maxLength", "minItems",
    "maxItems", "minProperties", "maxProperties", "pattern", "enum", "default",
)  # fmt: skip


def limits(schema):
    """Of each key what its value may be: by JSON Schema, alternatives and items with it."""
    found = {key: schema[key] for key in LIMITS if key in schema}
    for inner in ("items", "additionalProperties", "propertyNames"):
        if isinstance(schema.get(inner), dict) and (below := limits(schema[inner])):
            found[inner] = below
    if below := {key: limits(value) for key, value in schema.get("properties", {}).items()}:
        found["keys"] = {key: value for key, value in below.items() if value}
    if "required" in schema:
        found["required"] = sorted(schema["required"])
    return found


@pytest.mark.parametrize("of", [Model, Vehicle])
def test_what_a_file_may_say(changed, of):
    schema = of.model_json_schema()
    parts = {name: limits(part) for name, part in schema.get("$defs", {}).items()}
    assert not changed({"whole": limits(schema), **{name: part for name, part in parts.items() if part}})


def test_a_model_comes_back_from_its_file(tmp_path):
    model = small.model(settings={"levels": {"left": [0.4]}}, identified={"tests": [1, {"a": None}]})
    path = tmp_path / "below" / "model.json"
    path.parent.mkdir()
    path.write_text(model_file_text(model))
    assert load_model(path) == model
    lines = path.read_text().splitlines()
    assert lines[1] == ' "vehicle": {'
    assert path.read_text().endswith("}\n")
    intercept, past, response, noise = model.as_arrays()
    assert (intercept.tolist(), past.tolist()) == (model.intercept, model.past_coefficients)
    assert (response.tolist(), noise.tolist()) == (model.command_response, model.residual_covariance)


@pytest.mark.parametrize(("load", "most"), [(load_model, 20_000_000), (load_vehicle, 1_000_000)])
def test_a_file_larger_than_any_is_refused(tmp_path, load, most):
    """Just so large it is read, and found to lack what it should have."""
    path = tmp_path / "large.yaml"
    text = json.dumps({"name": "wing"})
    for size, says in ((most + 1, "allowed: at most"), (most, "required key is missing")):
        path.write_text(text + " " * (size - len(text)))
        with pytest.raises(BadInput, match=says):
            load(path)
