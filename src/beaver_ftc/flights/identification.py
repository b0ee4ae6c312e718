"""The whole of an identification: the fit, its tests on what it did not see, and what is said about both."""

from collections.abc import Sequence

from beaver_ftc.flights.identify import fit_model, stretches_of
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.samples import Samples
from beaver_ftc.flights.vehicle import Vehicle


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights, with its own account of how good it is in `identified`."""
    return fit_model(stretches_of(flights), vehicle)


def summary(model: Model) -> str:
    """What was found, in lines for people."""
    return f"{model.vehicle.name}: {model.history} past samples of the rates, {model.lags} of the commands"
