"""What of a certificate the scenario declares, its filter, its fields: by hand, not flown."""

import csv
from math import pi, radians
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_assurance.certificates import check_certificate, courses
from beaver_ftc_assurance.certificates.inequality import no_fault
from beaver_ftc_assurance.certificates.likelihood_ratio import Inputs, LikelihoodRatio
from telling import numbers


def test_what_a_scenario_declares_from_a_row_on():
    """Noise cut off at 4 standard deviations, bias, half a step of the resolution: 0.1, 0.03, 0.02 of p."""
    gyro = {"noise_std_deg_s": 0.1, "bias_deg_s": -0.03, "quantum_deg_s": 0.04, "scale_error": -0.2}
    later = dict.fromkeys("pqr", gyro | {"bias_deg_s": 0.5})
    scenario = {
        "rate_hz": 50, "substeps": 4, "changes": [
            {"at_s": 1.0, "law": "nominal"}, {"at_s": 2.001, "declared_sensors": later},
            {"at_s": 2.5, "sensors": later}, {"at_s": 3.0, "scheme": "x"},
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
    assert check_certificate.declared_at_row(scenario, 149).start_row == 101  # it is not told of new sensors
    assert check_certificate.declared_at_row(scenario, 150).start_row == 150


@pytest.mark.parametrize("pace", [1e-3, 1e9])
@pytest.mark.parametrize("keep", [1.0, 0.9])
def test_writer_and_checker_follow_the_same_filter(pace, keep):
    """Of two axes with everything: sums, and the room of a bounded drift, by its pace or as it swings."""
    n, count, dt, first = 2, 6, 0.02, 3
    nu = numbers(first + count, 3, seed=1)
    inputs = Inputs(
        signature=numbers(count, n, seed=2), jitter=abs(numbers(count, n, seed=3)) * 1e-4,
        drift=np.array([np.diag(row) for row in abs(numbers(count, n, seed=4)) * 1e-3]),
        bounded=abs(numbers(count, n, seed=5)), foreseen=numbers(count, n, seed=6),
        known=numbers(count, 1, n, seed=7), air=numbers(count, n, seed=8) * 0.1,
        pace=np.full(count, pace), keep=np.full(count, keep),
    )  # fmt: skip
    half = numbers(4, 4, seed=9)
    ours = LikelihoodRatio(
        level=5.0, axes=[0, 2], sense="either", tolerance=np.array([0.3]), R=np.array([0.5, 0.7]),
        P=half @ half.T, Y=numbers(4, 3, seed=10), first=first, series=inputs, dt=dt,
        innovation=nu[first:, [0, 2]],
    )  # fmt: skip
    totals, calm, ours_room = ours.sums()
    sums, room = check_certificate.whitened_sums(ours.fields, SimpleNamespace(dt=dt, innovation_rad_s2=nu))
    np.testing.assert_allclose(sums, [*totals, calm], rtol=1e-7)
    assert room == pytest.approx(ours_room, rel=1e-6)


def test_the_page_lists_the_fields_that_the_checker_accepts():
    page = Path(__file__).parents[4] / "docs" / "explanation" / "certificate-fields.csv"
    rows = csv.DictReader(page.read_text(encoding="utf-8").splitlines())
    listed = {row["field"] for row in rows if row["object"] != "log"}
    forms = [*check_certificate.FORMS.values(), *check_certificate.EVIDENCE.values()]
    assert listed == set().union(*(fields for form in forms for fields in form))


def test_an_oscillation_is_excluded_once_one_side_lasts_longer_than_half_of_its_period():
    """Half a period, 0.3 s, is 3 blocks: beyond the command by 0.05 rad and more from block 3 on."""
    kept = SimpleNamespace(tape=SimpleNamespace(first=0, frames=10))
    lower = np.where(np.arange(10) >= 3, 0.12 + 0.01 * np.arange(10), 0.0)
    bounds = courses.SurfaceBounds(
        first_frame=0, sign=1, lower=np.column_stack([lower, np.zeros(10)]), upper=lower,
        command=np.full(10, 0.1), axis_commands=lower, command_range=lower,
        is_unexplained=np.ones(10, bool), max_order=lower, stops=lower, held=no_fault(kept), actuator=None,
        config=SimpleNamespace(block_duration_s=0.1), slowest_rad_s=pi / 0.3,
    )  # fmt: skip
    found = courses.RULES["swing"](bounds)
    assert [(one["first"], one["frame"]) for one in found["bounds"]] == [(3, 7)]
    # of 0.05, 0.06, 0.07, 0.08, 0.09 rad the least, and the sum
    assert np.array(found["sides"]) == pytest.approx(np.array([(4, 0.05, 0.35), (3.0, 0.0, 0.0)]))
