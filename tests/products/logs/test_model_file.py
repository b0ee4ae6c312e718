"""Model files of strangers: numbers, shapes and covariances are checked before a flight is diagnosed."""

import json

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.model import load_model, model_file_text
from given import given

GIVEN = given(__file__)

G, LAGS, HISTORY = 2, 3, 2


def rising(first, *shape):
    """Numbers of which no two are alike."""
    return (first + 0.01 * np.arange(np.prod(shape))).reshape(shape).tolist()


MODEL = GIVEN["model"]  # fmt: skip


def written(tmp_path, *changes):
    data = json.loads(json.dumps(MODEL))
    for place, value in changes:
        *above, last = [int(key) if key.isdigit() else key for key in place.split(".")]
        section = data
        for key in above:
            section = section[key]
        section[last] = value
    path = tmp_path / "m.json"
    path.write_text(json.dumps(data))
    return path


def test_the_model_itself_is_one(tmp_path):
    its = load_model(written(tmp_path))
    assert its.lags == LAGS
    again = json.loads(model_file_text(its))
    assert MODEL.keys() <= again.keys()
    assert MODEL["fitted"].items() <= again["fitted"].items()


def test_a_file_of_release_1_0_has_keys_that_have_no_effect(tmp_path):
    former = [
        ("fitted.correlation", [[1.0]]), ("fitted.scale", 2), ("fitted.column_sd", {}),
        ("fitted.misread", 0.1), ("fitted.spread", [0.1, 0.2, 0.3]), ("settings", {"hold_s": 1.0}),
    ]  # fmt: skip
    assert load_model(written(tmp_path, *former)) == load_model(written(tmp_path))


SINGULAR = [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
WRONG = GIVEN["wrong"]  # fmt: skip


def test_what_is_wrong_is_said_in_a_line(tmp_path, changed):
    found = {}
    for i, (place, value, key) in enumerate(WRONG):
        path = written(tmp_path, (place, value))
        with pytest.raises(BadInput) as caught:
            load_model(path)
        lines = str(caught.value).replace(f"{path}:1: ", "").splitlines()
        assert any(line.startswith(f"{key}: ") and ", allowed: " in line for line in lines), lines
        found[f"{i} {place}"] = lines
    assert not changed(found)
