"""What the tests of recorded flights share: a synthetic vehicle, and the real flights if there are any."""

import os
import pickle
import warnings
from pathlib import Path

import pytest
from filelock import FileLock

from beaver_ftc_logs.identification import identify
from beaver_ftc_logs.loading import load_flights_for_fit
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import synthetic

REAL = "BEAVER_FTC_FLIGHTS"


@pytest.fixture(autouse=True)
def _no_warning_of_numpy():
    """A mean of nothing, or a division by zero, is a mistake here: none may reach a user's screen."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield


@pytest.fixture(scope="session")
def real_flights():
    """The folder of the recorded data sets; the tests that want it are skipped where it is absent."""
    default = Path(__file__).parents[4] / "shared" / "flights"
    folder = Path(os.environ.get(REAL, default))
    if not (folder / "enac" / "flight-21.csv").is_file():
        pytest.skip(f"no recorded flights at ../shared/flights beside the checkout, nor at ${REAL}")
    return folder


@pytest.fixture(scope="session")
def wing_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("wing")


@pytest.fixture(scope="session")
def wing(wing_folder):
    path = wing_folder / "wing.yaml"
    path.write_text(synthetic.VEHICLE)
    return load_vehicle(path)


@pytest.fixture(scope="session")
def sampled(wing, wing_folder):
    """Makes samples of a flight of the wing, or of columns changed, as `identify` and `diagnose` get them."""

    def samples(*duration_s, columns=None, of=wing, **flown):
        path = wing_folder / "flight.csv"
        synthetic.write_csv(path, columns or synthetic.fly(*duration_s, **flown))
        return load_flights_for_fit([path], of)[0]

    return samples


@pytest.fixture(scope="session")
def wing_model(sampled, wing, tmp_path_factory, testrun_uid):
    """Identified by the worker that asks first."""
    kept = tmp_path_factory.getbasetemp().parent / f"wing-{testrun_uid}.pickle"
    with FileLock(kept.with_suffix(".lock")):
        if not kept.exists():
            flight = sampled(400.0, parts=((150, 220, 1.0, 0.5), (300, 340, 0.4, 1.0)), seed=5)
            kept.write_bytes(pickle.dumps(identify([flight], wing)))
    return pickle.loads(kept.read_bytes())
