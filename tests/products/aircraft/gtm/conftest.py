"""The converted model, where the data base is; without it these tests are skipped."""

import pytest
from tools.gtm.specification import DATABASE, WHERE, Specification, folder

from beaver_ftc_aircraft.gtm.database import read
from beaver_ftc_aircraft.gtm.folder import write_model
from beaver_ftc_aircraft.gtm.steady import Bench


@pytest.fixture(scope="session")
def where():
    found = folder()
    if found is None:
        pytest.skip(
            f"no data base of the GTM at ../shared/reference/gtm beside the checkout, nor at ${WHERE}"
        )
    return found


@pytest.fixture(scope="session")
def model(where, tmp_path_factory):
    return write_model(read(where / DATABASE), tmp_path_factory.mktemp("model") / "gtm")


@pytest.fixture(scope="session")
def bench(model):
    return Bench(model)


@pytest.fixture(scope="session")
def specified(where):
    return Specification(where)
