"""The form of a certificate, field by field, and what of it the scenario declares: by hand, not flown."""

import copy
import csv
from math import pi, radians
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_assurance.certificates import check_certificate, courses
from beaver_ftc_assurance.certificates.chance import LikelihoodRatio
from beaver_ftc_assurance.certificates.check_certificate import Refused, check_statement_form
from telling import numbers

EVENT = {"what": "flap", "column": "fie_flap_excluded", "frame": 44}
TERM = {
    "weight": 0.7, "d": [0.1, -0.2, 0.3], "first": 41, "frame": 42, "x": [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]],
    "F": [[1.1, 1.2, 1.3], [1.4, 1.5, 1.6]], "eta_bar": [[0.7, 0.8, 0.9], [0.11, 0.12, 0.13]],
    "h": [0.21, None], "Z": [0.31, 0.32], "r": [0.41, 0.0], "pole_per_s": 1.5, "since": 40, "fault": 0.2,
}  # fmt: skip
BOUND = {"d": [0.1, -0.2, 0.3], "first": 41, "frame": 42, "h": [0.1, 0.2], "Z": [0.3, -0.4], "r": [0.5, 0.6]}
FRAME = {
    "signature": [1.1, -1.2], "jitter": [0.0, 0.2], "drift": [[2.0, 0.3], [0.3, 1.0]],
    "known": [[0.4, 0.5]], "air": [0.6, -0.7],
}  # fmt: skip
SUM = EVENT | {"theta": "constant", "terms": [TERM], "sides": [2.0, 1.0]}
COURSE = EVENT | {"theta": "course", "bounds": [BOUND], "sides": [[3.0, 1.0], [2.0, 0.5]]}
LOOKS = EVENT | {"test": "theta", "looks": [[1.0, 2.0, 3.0]], "sides": [2.0, 1.0]}
CHANCE = EVENT | {
    "likelihood": "flap_loss", "level": 3.2, "axes": [0, 2], "sense": "less", "tolerance": [0.7],
    "R": [1e-6, None], "Y": [[0.1 * i, 0.2, None] for i in range(4)], "first": 41,
    "P": [[2.0, 0.1, 0.2, 0.3], [0.1, 3.0, 0.4, 0.5], [0.2, 0.4, 0.0, 0.6], [0.3, 0.5, 0.6, 5.0]],
    "frames": [FRAME, FRAME | {"signature": [2.1, 2.2]}], "sides": [[1.0, 2.0], [3.0, 4.0]],
}  # fmt: skip
FORMS = SUM, COURSE, LOOKS, CHANCE
# Of a statement that is right: what is another number, and why it is refused.
WRONG = [
    (SUM, "theta", "course"), (SUM, "frame", -1), (SUM, "looks", [[1.0, 2.0, 3.0]]), (SUM, "note", "true"),
    (SUM, "terms.0.weight", 0), (SUM, "terms.0.d", [0.0, 0.0, 0.0]), (SUM, "terms.0.first", 43),
    (SUM, "terms.0.first", 0), (SUM, "terms.0.r", [0.1, -0.1]), (SUM, "terms.0.pole_per_s", -1.0),
    (SUM, "terms.0.fault", -0.1), (COURSE, "bounds.0.Z", [0.3, 0.0]), (COURSE, "pace_rad_s", 0.0),
    (COURSE, "step", -1e-9), (CHANCE, "level", 0.0), (CHANCE, "axes", [2, 2]), (CHANCE, "axes", [0, 3]),
    (CHANCE, "sense", "more"), (CHANCE, "R", [1e-6, -1.0]), (CHANCE, "P.3.0", 0.31), (CHANCE, "P.2.2", -1e-9),
    (CHANCE, "P.3.3", -5.0), (CHANCE, "first", 0), (CHANCE, "frames.0.jitter", [0.1, -0.1]),
    (CHANCE, "frames.1.drift", [[2.0, 0.3], [0.2, 1.0]]),
    (CHANCE, "frames.0.drift", [[0.1, 0.3], [0.3, 0.1]]),
    (CHANCE, "frames.0.keep", 1.1), (CHANCE, "frames.1.keep", 0.9), (CHANCE, "frames.0.pace", -0.1),
    (CHANCE, "tolerance", [0.0]),
]  # fmt: skip


def places(value, *above):
    """Each number, text and list of a statement, by its keys."""
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    if above:
        yield ".".join(map(str, above)), value
    for key in keys:
        yield from places(value[key], *above, key)


@pytest.mark.parametrize("statement", FORMS, ids=check_certificate.evidence_kind)
def test_what_has_another_form_anywhere_is_refused(statement):
    check_statement_form(statement)
    for place, value in places(statement):
        for other in (3, {}) if isinstance(value, str) else ("text", float("nan"), float("inf"), {}):
            with pytest.raises(Refused):
                check_statement_form(altered(statement, place, other)), place
        if isinstance(value, list) and place.partition(".")[0] != "sides" and place != "frames":
            with pytest.raises((Refused, ValueError)):  # a matrix of uneven rows is none
                check_statement_form(altered(statement, place, value[:-1])), place


def altered(statement, place, value):
    said = at = copy.deepcopy(statement)
    *above, last = [int(key) if key.isdigit() else key for key in place.split(".")]
    for key in above:
        at = at[key]
    at[last] = value
    return said


def test_what_is_another_is_refused_in_words(changed):
    found = {}
    for statement, place, value in WRONG:
        with pytest.raises(Refused) as refused:
            check_statement_form(altered(statement, place, value))
        found[f"{check_certificate.evidence_kind(statement)} {place} {value}"] = str(refused.value)
    assert not changed(found)


def test_what_a_scenario_declares_from_a_row_on():
    """Noise cut off at 4 standard deviations, bias, half a step of the resolution: 0.1, 0.03, 0.02 of p."""
    gyro = {"noise_std_deg_s": 0.1, "bias_deg_s": -0.03, "quantum_deg_s": 0.04, "scale_error": -0.2}
    later = dict.fromkeys("pqr", gyro | {"bias_deg_s": 0.5})
    scenario = {
        "rate_hz": 50, "substeps": 4, "changes": [
            {"at_s": 1.0, "law": "nominal"}, {"at_s": 2.001, "declared_sensors": later},
            {"at_s": 3.0, "scheme": "x"},
        ],
        "fdi": {"bounds": {"sensors": dict.fromkeys("pqr", gyro), "constant_rad_s2": {"p": 0.3},
                           "inertia_coupling": {"q": 0.4}}},
    }  # fmt: skip
    found = check_certificate.declared_at_row(scenario, 100)  # the second change is in force from row 101 on
    assert (found.dt, found.instants, found.start_row) == (0.02, 4, 0)
    assert (found.constant_bounds, found.inertia_shares) == ({"p": 0.3}, {"q": 0.4})
    assert found.gyro_errors["p"] == pytest.approx((radians(0.1 * 4 + 0.03 + 0.02), radians(0.03), 0.2))
    changed = check_certificate.declared_at_row(scenario, 101)
    assert changed.start_row == 101
    assert changed.gyro_errors["q"][:2] == pytest.approx((radians(0.4 + 0.5 + 0.02), radians(0.5)))
    assert check_certificate.declared_at_row(scenario, 150).start_row == 150


@pytest.mark.parametrize("pace", [1e-3, 1e9])
@pytest.mark.parametrize("keep", [1.0, 0.9])
def test_writer_and_checker_follow_the_same_filter(pace, keep):
    """Of two axes with everything: sums, and the room of a bounded drift, by its pace or as it swings."""
    n, count, dt, first = 2, 6, 0.02, 3
    nu = numbers(first + count, 3, seed=1)
    inputs = {
        "signature": numbers(count, n, seed=2), "jitter": abs(numbers(count, n, seed=3)) * 1e-4,
        "drift": np.array([np.diag(row) for row in abs(numbers(count, n, seed=4)) * 1e-3]),
        "bounded": abs(numbers(count, n, seed=5)), "foreseen": numbers(count, n, seed=6),
        "known": numbers(count, 1, n, seed=7), "air": numbers(count, n, seed=8) * 0.1,
        "pace": np.full(count, pace), "keep": np.full(count, keep),
    }  # fmt: skip
    half = numbers(4, 4, seed=9)
    ours = LikelihoodRatio(
        level=5.0, axes=[0, 2], sense="either", tolerance=np.array([0.3]), R=np.array([0.5, 0.7]),
        P=half @ half.T, Y=numbers(4, 3, seed=10), first=first, frames=inputs, dt=dt,
        innovation=nu[first:, [0, 2]],
    )  # fmt: skip
    totals, calm, ours_room = ours.sums()
    frames = SimpleNamespace(dt=dt, innovation_rad_s2=nu)
    sums, room = check_certificate.whitened_sums(ours.fields, frames)
    np.testing.assert_allclose(sums, [*totals, calm], rtol=1e-7)
    assert room == pytest.approx(ours_room, rel=1e-6)


def test_the_page_lists_the_fields_that_the_checker_accepts():
    page = Path(__file__).parents[4] / "docs" / "explanation" / "certificate-fields.csv"
    rows = csv.DictReader(page.read_text(encoding="utf-8").splitlines())
    listed = {row["field"] for row in rows if row["object"] != "log"}
    forms = [*check_certificate.FORMS.values(), *check_certificate.EVIDENCE.values()]
    assert listed == set().union(*(fields for form in forms for fields in form))


def test_an_oscillation_is_excluded_once_one_side_lasts_longer_than_half_of_its_period():
    """Half a period of 0.3 s is 3 frames: beyond the command by 0.05 rad and more from the third frame on."""
    lower = np.where(np.arange(10) >= 3, 0.12 + 0.01 * np.arange(10), 0.0)
    bounds = courses.SurfaceBounds(
        first_frame=0, sign=1, lower=np.column_stack([lower, np.zeros(10)]), upper=lower,
        command=np.full(10, 0.1), axis_commands=lower, command_range=lower,
        is_unexplained=np.ones(10, bool), max_order=lower, stops=lower,
    )  # fmt: skip
    found = courses.RULES["swing"](bounds, None, SimpleNamespace(half_blocks=3, dt_s=0.1), pi / 0.3)
    assert list(found.lower_frames) == [3, 4, 5, 6, 7]
    beyond = [0.05, 0.06, 0.07, 0.08, 0.09]
    assert np.array(found.pairs) == pytest.approx(np.array([(4, 3.0), (0.05, 0.0), (sum(beyond), 0.0)]))
