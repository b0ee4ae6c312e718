"""What is fitted, of which order, and how it is tested elsewhere: on flights of models that are known."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import fitting, gains, orders, validation
from beaver_ftc_logs.fit_parts import FitPart, fit_parts, usable_mask
from beaver_ftc_logs.recording import LoggedFailure
from products.logs import small

MODEL = small.model()
LOST = ((1, 300, 400, 0.5), (0, 600, 700, 0.4))


def labelled(parts, dt_s=0.5, **changes):
    """Samples whose labels are these: (count, right, left)."""
    labels = np.array([left for count, *left in parts for _ in range(count)], dtype=float)
    n = len(labels)
    given = {
        "labels": labels,
        "dt_s": dt_s,
        "t_s": dt_s * np.arange(n),
        "stretch_number": np.zeros(n, dtype=int),
    }
    return replace(small.flight(MODEL, n), **given, **changes)


NAN = np.nan
USED = {  # at 2 Hz: three samples at either edge of a label, all of what lasts less than six
    "a level for six samples": ([(10, 1, 1), (6, 1, 0.5), (9, 1, 1)], [3, 4, 5, 6, 19, 20, 21]),
    "for seven": ([(10, 1, 1), (7, 0.4, 1), (8, 1, 1)], [3, 4, 5, 6, 13, 20, 21]),
    "for five": ([(10, 1, 1), (5, 1, 0.5), (10, 1, 1)], [3, 4, 5, 6, 18, 19, 20, 21]),
    "one label is none": ([(8, 1, 1), (8, 1, NAN), (8, NAN, 1), (7, 1, 1)], [3, 4, 27]),
    "one surface has labels": ([(8, 1, NAN), (8, 0.5, NAN)], [3, 4, 11, 12]),
    "nothing is said": ([(4, NAN, NAN)], [0, 1, 2, 3]),
}


@pytest.mark.parametrize("name", USED)
def test_which_samples_are_known(name):
    parts, used = USED[name]
    assert np.flatnonzero(usable_mask(labelled(parts))).tolist() == used


def test_what_follows_a_failure_is_not_fitted():
    """From a second before the first failure on."""
    samples = labelled(
        [(20, NAN, NAN)], logged_failures=(LoggedFailure(6.0, "rudder"), LoggedFailure(5.0, "elevator"))
    )
    assert np.flatnonzero(usable_mask(samples)).tolist() == list(range(8))


def test_a_fit_wants_ten_samples_a_coefficient():
    """13 coefficients an axis: 130 samples will do, 129 will not."""
    samples = small.flight(MODEL, 146)
    use = np.ones(146, dtype=bool)
    use[136:] = False
    assert orders.fit_order([FitPart(samples, use)], MODEL.vehicle, 2, 3).coefficients.shape == (13, 3)
    use[135] = False
    says = "129 samples known to be healthy, allowed: at least 130 to fit 13 coefficients an axis"
    with pytest.raises(BadInput, match=says):
        orders.fit_order([FitPart(samples, use)], MODEL.vehicle, 2, 3)


@pytest.mark.parametrize(
    ("changes", "key"), [({"rates": [0, 0, 2]}, "noise"), ({"commands": 1e-8}, "response")]
)
def test_what_no_model_file_can_hold_is_refused(changes, key):
    """One rate twice; commands a hundred millionth of what they are."""
    samples = small.flight(MODEL, 300)
    changed = {"rates": lambda by: samples.rates[:, by], "commands": lambda by: samples.commands * by}
    told = replace(samples, **{name: changed[name](by) for name, by in changes.items()})
    with pytest.raises(BadInput, match=f"no model file can hold the {key} of this fit, allowed: three rates"):
        orders.fitted_order(fit_parts([told]), MODEL.vehicle, 2, 3)


@pytest.fixture(scope="module")
def usable_flights():
    return fit_parts([small.flight(MODEL, 1000, lost=LOST)])


@pytest.fixture(scope="module")
def fitted(usable_flights):
    return fitting.fit_model(usable_flights, MODEL.vehicle)


def test_tests_on_what_was_not_fitted(changed, fitted, usable_flights):
    quick = fitted.settings.model_copy(update={"delays_s": [0.0]})
    entries, bounds = validation.score_folds(usable_flights, fitted.model_copy(update={"settings": quick}))
    assert not changed({"entries": entries, "bounds": bounds})
    assert [entry["left_out"] for entry in entries] == ["second half", "first half"]
    assert all(0.8 < share < 1.0 for entry in entries for share in entry["explained"].values())
    assert all(entry["score"]["classes"] > 0.8 for entry in entries)


def days(gains):
    """Flights of days on which the right surface acts so many times as the left one does."""
    flown = [small.flight(MODEL, 1500, seed=20 + i, name=f"day-{i}") for i in range(len(gains))]
    told = [replace(one, labels=np.full_like(one.labels, np.nan)) for one in flown]
    return fit_parts(
        [replace(one, commands=one.commands / [gain, 1.0]) for one, gain in zip(told, gains, strict=True)]
    )


def test_flights_that_are_alike_tell_all_that_their_noise_allows():
    """The squares of Gaussian gains are as many as these, on average: 12 of them, within three sd of that."""
    alike = gains.gain_overdispersion(days([1.0] * 6), MODEL)
    assert alike == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / 12.0))


def test_days_that_differ_let_a_sample_tell_less():
    """Differences far above what the noise allows: the larger they are, the less."""
    none, some, more = (
        gains.gain_overdispersion(days(1.0 + size * np.tile([-1, 1], 3)), MODEL) for size in (0.0, 0.15, 0.3)
    )
    assert more > 1.5 * some > 5.0 * none
    assert fitting.estimate_filter_settings(days([0.7, 1.3] * 3), MODEL).power < 0.2
