"""An aircraft of the jsbsim package that a scenario names before anybody derived it: it is derived then."""

from collections.abc import Callable

from beaver_ftc.aircraft.loading import is_derived
from beaver_ftc.studies.derive.run import derive
from beaver_ftc.studies.derive.source import FROM_JSBSIM, source_of


def derived_if_needed(reference: str, tell: Callable[[str], None] = lambda line: None) -> None:
    """Derive `jsbsim:NAME` if the cache has it not, or as an earlier version made it. Raises as `derive`."""
    name = reference.removeprefix(FROM_JSBSIM)
    if name != reference and not is_derived(name):
        source_of(reference)  # raises for what is no aircraft, before anything is promised
        tell(f"{reference}: deriving its design model, once; some seconds")
        derive(reference)
