"""Who may diagnose a recorded flight: our bank of filters, plain least squares, and the loop's detectors."""

from beaver_ftc.diagnosis.base import Detector
from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.flights.diagnose import Rows, check_rate, diagnose
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.plain import forgetting, sliding
from beaver_ftc.flights.samples import Samples
from beaver_ftc.flights.stream import run_detector
from beaver_ftc.plugins import DETECTORS, is_compiled, made, registered

BANK = "bank-of-filters"
_OF_FLIGHTS = {BANK: diagnose, "sliding-least-squares": sliding, "forgetting-least-squares": forgetting}


def detector_names() -> list[str]:
    """Every detector a recorded flight can be given to, ours first."""
    return [*_OF_FLIGHTS, *(name for name in registered(DETECTORS) if not is_compiled(DETECTORS, name))]


def check_detector(name: str) -> None:
    """Raise BadInput for a detector that recorded flights do not know."""
    known = detector_names()
    if name not in known:
        raise BadInput(f"--detector {name}: is not known{suggestion(name, known)}")


def diagnose_with(name: str, samples: Samples, model: Model) -> Rows:
    """The rows of one detector. Raises BadInput for an unknown name, or a log at another rate."""
    check_detector(name)
    check_rate(samples, model)
    if name in _OF_FLIGHTS:
        return _OF_FLIGHTS[name](samples, model)
    detector: Detector = made(DETECTORS, name)
    return run_detector(detector, samples, model)
