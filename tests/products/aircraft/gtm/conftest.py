"""The converted model, of the data base where it is, else of a made one in the same form."""

import pytest
from tools.gtm.specification import DATABASE, WHERE, Specification, folder

from beaver_ftc_aircraft.gtm.database import read
from beaver_ftc_aircraft.gtm.folder import write_model
from beaver_ftc_aircraft.gtm.steady import Bench
from products.aircraft.gtm import made


@pytest.fixture(scope="session")
def where():
    """NASA's own data: for what needs an aircraft that flies."""
    found = folder()
    if found is None:
        pytest.skip(
            f"no data base of the GTM at ../shared/reference/gtm beside the checkout, nor at ${WHERE}"
        )
    return found


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    return folder() or made.write(tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="session")
def model(data, tmp_path_factory):
    return write_model(read(data / DATABASE), tmp_path_factory.mktemp("model") / "gtm")


@pytest.fixture(scope="session")
def bench(model):
    return Bench(model)


@pytest.fixture(scope="session")
def specified(data):
    return Specification(data)
