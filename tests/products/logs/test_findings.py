"""What a verdict says, of rows and flights made by hand."""

import numpy as np
import pytest

from beaver_ftc_logs.findings import (
    as_text,
    duration_text,
    fault_events,
    isolability_document,
    isolability_sentences,
    verdict_document,
)
from beaver_ftc_logs.regression import unexplained_rates
from products.logs import small

NAMES = ["right", "left"]
SOUND, HALF, LESS = ("", [1.0, 1.0]), ("left", [1.0, 0.5]), ("left", [1.0, 0.4])
PARTS = {
    "nothing": [(20, *SOUND)],
    "one": [(20, *SOUND), (20, *HALF), (20, *SOUND)],
    "to the end": [(3, *SOUND), (20, *HALF)],
    "two in turn": [(8, *HALF), (9, *LESS), (7, "right", [0.2, 1.0])],
    "a brief level within": [(10, *HALF), (3, *LESS), (10, *HALF), (5, *SOUND)],
    "just brief, just not": [(10, *HALF), (6, *LESS), (10, *HALF), (7, *LESS)],
    "brief ones alone": [(5, *SOUND), (6, *HALF), (5, *SOUND), (2, "right", [0.1, 1.0]), (5, *SOUND)],
    "brief before one that lasts": [(4, *LESS), (9, *SOUND), (9, *HALF)],
    "no one knows which": [(4, *SOUND), (9, "unknown", [0.9, 0.8])],
    "both": [(4, *SOUND), (9, "right+left", [0.3, 0.6]), (3, *SOUND)],
}


@pytest.mark.parametrize("name", PARTS)
def test_rows_become_events(changed, name):
    assert not changed(fault_events(small.rows(PARTS[name]), NAMES))


WORLD = {
    "wing": (small.model(settings={"power": 0.8, "levels": {"left": [0.4]}}), {}),
    "tail": (
        small.model(small.TAIL, settings={"alarm": 0.9}),
        {"gap": 150, "notes": ("a remark",), "held_age_s": {"roll": 0.123456}},
    ),
}


@pytest.fixture(scope="module", params=WORLD)
def flown(request):
    model, changes = WORLD[request.param]
    return model, small.flight(model, **changes)


def test_the_document_of_a_verdict(changed, flown):
    model, samples = flown
    surfaces = list(model.vehicle.surfaces)
    left = [1.0, 0.5, 0.7][: len(surfaces)]
    rows = small.rows([(8, "", [1.0] * len(left)), (9, "+".join(surfaces[1:]), left)], len(left))
    assert not changed(verdict_document(samples, model, rows))


def events(*parts):
    return fault_events(small.rows(parts), NAMES)


VERDICT = {
    "flight": "one", "gaps": 0, "duration_s": 61.4, "recorded_s": 41.6, "events": [],
    "can_separate": ["First.", "Second."], "notes": [], "credible": {"share": 1.0, "reasons": []},
}  # fmt: skip


def test_the_text_of_a_verdict(changed):
    one, two = events(*PARTS["one"]), events(*PARTS["two in turn"])
    mixed = events(*PARTS["brief before one that lasts"])
    unknown = events(*PARTS["no one knows which"])
    brief = events(*PARTS["brief ones alone"])
    score = {"classes": 0.98765, "rows": 4, "side": None}
    cases = [
        VERDICT,
        VERDICT | {"events": one, "gaps": 1},
        VERDICT | {"events": two, "gaps": 2, "notes": ["A remark."]},
        VERDICT | {"events": mixed, "score": score},
        VERDICT | {"events": unknown},
        VERDICT | {"events": brief},
        VERDICT | {"credible": {"share": 0.0, "reasons": [{"says": "a rate is clipped", "share": 1.0}]}},
    ]
    assert not changed([as_text(case).splitlines() for case in cases])
    assert [duration_text(case) for case in cases[:3]] == [
        "61 s", "42 s, 1 gap in the log left out", "42 s, 2 gaps in the log left out",
    ]  # fmt: skip


def test_what_a_flight_can_separate_in_words():
    """By size, by none, and of groups that move the rates alike."""
    losses = {"5": None, "20": 0.5, "60": 0.123}
    groups = [
        {"surfaces": ["right"], "smallest_loss": losses},
        {"surfaces": ["left", "flap"], "smallest_loss": dict.fromkeys(losses)},
    ]
    pairs = [
        {"surfaces": [["right"], ["left", "flap"]], "cosine": -0.954, "separable": False},
        {"surfaces": [["right"], ["rudder"]], "cosine": 0.1, "separable": True},
    ]
    together = [{"surfaces": ["left", "flap"], "says": "They move together."}]
    assert isolability_sentences({"together": together, "groups": groups, "alike": pairs}) == [
        "They move together.",
        "right: the smallest loss that shows on average is 50% within 20 s, 12% within 60 s.",
        "left, flap: not even a complete loss would show within 60 s by the mean of this flight's commands.",
        "In this flight the effects of right and of left and flap were nearly proportional (cosine -0.95): "
        "one may be named for the other.",
    ]


def test_what_motion_alone_tells_is_what_is_left_of_the_regression(flown):
    """The Schur complement of the whole information matrix, trim of each axis and the other groups out."""
    model, samples = flown
    ok_answers = _white_responses(samples, model)
    n, groups, _ = ok_answers.shape
    design = np.concatenate([ok_answers.transpose(0, 2, 1), np.tile(np.eye(3), (n, 1, 1))], axis=2)
    flat = design.reshape(-1, groups + 3)
    covariance = np.linalg.inv(flat.T @ flat)
    for group, entry in enumerate(isolability_document(samples, model)["groups"]):
        left = 1.0 / covariance[group, group] / n / samples.dt_s
        assert entry["information_per_s_of_its_motion"] == pytest.approx(left, rel=1e-9)


def _white_responses(samples, model):
    ok, _, answers = unexplained_rates(samples, model)
    root = np.linalg.inv(np.linalg.cholesky(np.array(model.residual_covariance))) * np.sqrt(
        model.settings.effective_sample_share
    )
    return answers[ok] @ root.T
