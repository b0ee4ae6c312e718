"""On the recorded data sets, where they are: the bars of the product, on parts the model has not seen.

Skipped with a reason where the data is absent (it is not ours to copy).
"""

import numpy as np
import pytest

from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.fit_parts import fit_parts
from beaver_ftc_logs.fitting import fit_model
from beaver_ftc_logs.folds import validation_folds
from beaver_ftc_logs.loading import load_flights_for_fit
from beaver_ftc_logs.scoring import score_against_failures, score_against_labels
from beaver_ftc_logs.validation import add_ranges_and_threshold
from beaver_ftc_logs.vehicle import load_vehicle

ALFA = "carbonZ_2018-09-11-15-06-34_1_rudder_right_failure"


@pytest.fixture(scope="module")
def enac(real_flights):
    vehicle = load_vehicle(real_flights / "enac" / "vehicle.yaml")
    return vehicle, load_flights_for_fit([real_flights / "enac" / "flight-21.csv"], vehicle)[0]


@pytest.mark.parametrize("fold", [0, 1])
def test_half_of_a_flying_wing_by_the_other(enac, fold):
    vehicle, samples = enac
    usable_flights = fit_parts([samples])
    fitted, kept, _ = validation_folds(usable_flights)[fold]
    model = fit_model(fitted, vehicle, fit_model(usable_flights, vehicle).settings)
    labels = np.where(kept.is_usable[:, None], samples.labels, np.nan)
    found = score_against_labels(diagnose(samples, model), labels)
    assert found["classes"] > 0.75
    assert found["healthy_or_faulty"] > 0.85
    assert found["side"] > 0.85
    assert found["mean_error"] < 0.04


def test_a_rudder_hard_over_is_found_by_its_effect_alone(real_flights):
    vehicle = load_vehicle("alfa")
    folders = sorted(path for path in (real_flights / "alfa").iterdir() if path.is_dir())
    flights = load_flights_for_fit(folders, vehicle)
    kept = next(one for one in flights if one.name == ALFA)
    others = fit_parts([one for one in flights if one is not kept])
    model = add_ranges_and_threshold(others, fit_model(others, vehicle))
    read = {*model.vehicle.command_columns, *model.vehicle.signal_columns}
    assert not read & {one.column for one in model.vehicle.outputs.values()}
    found = score_against_failures(diagnose(kept, model), kept.logged_failures, model.groups)
    assert found["false_alarms"] == 0
    assert found["delay_s"] < 5.0
    assert found["right_group"] is True
