"""Show a flight in FlightGear in real time, by the output of JSBSim."""

import time
from collections.abc import Callable

from beaver_ftc.aircraft import DEFAULT
from beaver_ftc.documents import SimulationFailed
from beaver_ftc.plant import Plant

DIRECTIVE = f"aircraft/{DEFAULT}/flightgear.xml"


def show_in_flightgear(plant: Plant, host: str, port: int) -> None:
    """Send the state of the plant to FlightGear from its start on, and delay its frames to real time.

    Call it before `Plant.start`, in which JSBSim opens the socket. UDP needs no receiver.
    """
    loaded = plant.fdm.set_output_directive(DIRECTIVE)
    # JSBSim 1.3.3 documents HOST:PORT/PROTOCOL, and takes HOST:PROTOCOL/PORT.
    if not loaded or not plant.fdm.set_output_filename(0, f"{host}:UDP/{port}"):
        raise SimulationFailed(f"JSBSim cannot load {DIRECTIVE}")
    plant.fdm.enable_output()
    plant.run = paced(plant.run, plant.dt_s)


def paced(
    run: Callable[[], bool],
    dt_s: float,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Callable[[], bool]:
    """`run`, delayed until dt_s after the last call was due. After a late call, the next do not catch up."""
    due = clock()

    def on_time() -> bool:
        nonlocal due
        due = max(due + dt_s, clock())
        sleep(max(0.0, due - clock()))
        return run()

    return on_time
