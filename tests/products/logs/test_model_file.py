"""Model files of strangers: numbers, shapes and covariances are checked before a flight is diagnosed."""

import json

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.model import load_model, model_file_text

G, LAGS, HISTORY = 2, 3, 2


def rising(first, *shape):
    """Numbers of which no two are alike."""
    return (first + 0.01 * np.arange(np.prod(shape))).reshape(shape).tolist()


MODEL = {
    "vehicle": {
        "name": "wing", "rates": {axis: {"column": axis} for axis in "pqr"}, "commands": ["a", "b"],
        "surfaces": {"left": {"a": 0.5, "b": 0.4}, "right": {"a": 0.3, "b": -0.6}},
    },
    "rate_hz": 20.0, "groups": [["left"], ["right"]], "history": HISTORY, "lags": LAGS,
    "intercept": [0.01, 0.02, 0.03],
    "past": rising(0.0, 3 * HISTORY, 3), "response": rising(0.2, G, LAGS, 3),
    "response_sd": rising(0.1, G, LAGS, 3),
    "noise": [[2.0, 0.1, 0.2], [0.1, 3.0, 0.3], [0.2, 0.3, 4.0]],
    "colours": [{"average": [1.0, 0.5], "noise": [[2.5, 0.1, 0.2], [0.1, 3.5, 0.3], [0.2, 0.3, 4.5]]}],
    "fitted": {
        "commands": [[-0.5, 0.4], [-0.3, 0.6]], "rates": [[-1, 2], [-2, 3], [-3, 4]],
        "tied": [0.1, 0.2], "gain_sd": [0.3, 0.4],
        "tail": {"level": 3.0, "excess": [1.5, 0.5], "minutes": 30.0, "dispersion": 1.2},
    },
}  # fmt: skip


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
WRONG = [
    ("groups", [["left"], []], "groups[1]"), ("groups", [["left"], ["left"]], "groups[1][0]"),
    ("groups", [["left"], ["tail"]], "groups[1][0]"), ("groups", [["left"]], "response"),
    ("response", MODEL["response"][:1], "response"),
    ("response.1.2", [0.1, 0.2], "response"), ("response_sd.0", [[0.1, 0.2, 0.3]], "response_sd"),
    ("response_sd.1.2.0", -0.1, "response_sd[1][2][0]"), ("past.3", [0.1, 0.2], "past"),
    ("past.3.1", 1e300, "past[3][1]"), ("noise", [[1, 0], [0, 1]], "noise"),
    ("noise", SINGULAR, "noise"), ("noise.0.1", 0.11, "noise"), ("noise.1.1", -3.0, "noise"),
    ("noise.2.2", 1e-13, "noise"), ("colours.0.noise", SINGULAR, "colours[0].noise"),
    ("colours.0.average", [2.0], "colours[0].average"),
    ("colours.0.before", [[1.0, 0, 0]], "colours[0].before"),
    ("fitted.rates", [[-1, 2]], "fitted.rates"), ("fitted.airspeed", [1.0], "fitted.airspeed"),
    ("fitted.tied", [0.1], "fitted.tied"),
    ("fitted.gain_sd", [0.1, -0.4], "fitted.gain_sd[1]"), ("fitted.commands", [[1.0]], "fitted.commands"),
    ("fitted.commands", [[0.0, 1.0]], "fitted.commands"),
    ("settings", {"level_step": 1e-9}, "settings.level_step"),
    ("settings", {"levels": {"tail": [0.5]}}, "settings.levels.tail"),
    ("settings", {"levels": {"left": [1.5]}}, "settings.levels.left[0]"),
    ("settings", {"delays_s": [0.0, 0.06]}, "settings.delays_s[1]"),
    ("settings", {"trim_walk": [0.1, -0.1, 0.2]}, "settings.trim_walk[1]"),
    ("settings", {"gain_time_s": 1e300}, "settings.gain_time_s"), ("rate_hz", 1e-9, "rate_hz"),
    ("rate_hz", 1e9, "rate_hz"), ("intercept.0", 1e7, "intercept[0]"),
    ("colours.0.misreads", [0.1], "colours[0].misreads"),
]  # fmt: skip


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
