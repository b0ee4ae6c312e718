"""Logs of others: a unit that a name states holds where the angles say nothing of it; a VTOL that hovers."""

import numpy as np
import pytest

from beaver_ftc_logs.check import check_log
from beaver_ftc_logs.recording import Column
from beaver_ftc_logs.rotorcraft import VTOL_MODE, hovers_throughout

T = np.arange(400) / 20.0
WAVES = np.sin(T), np.cos(T), np.sin(2.0 * T)


@pytest.mark.parametrize(("unit", "factor"), [("deg/s", 80.0), ("rad/s", 0.5)])
@pytest.mark.parametrize("roll", [5.0 * (1.0 - np.cos(T)), np.sin(9.0 * T)], ids=["other slope", "unrelated"])
def test_the_unit_in_a_name_is_that_of_the_rates(tmp_path, unit, factor, roll):
    """As JSBSim writes them: the roll angle is five times, or nothing of, the integral of the rate."""
    heads = ["Time", *(f"{axis} ({unit})" for axis in "PQR"), "Phi (rad)", "Elevator Command (norm)"]
    columns = [T, *(factor * wave for wave in WAVES), roll, np.sin(T)]
    log = tmp_path / "log.csv"
    np.savetxt(log, np.transpose(columns), delimiter=",", header=",".join(heads), comments="")
    rates = check_log(log, None, None)["vehicle"]["rates"]
    assert rates["p"] == ("P (rad/s)" if unit == "rad/s" else {"column": "P (deg/s)", "unit": "deg/s"})


@pytest.mark.parametrize(("mav_type", "modes", "hovers"), [
    (22.0, [1, 1, 1], True), (22.0, [1, 2, 1], False), (1.0, [1, 1, 1], False), (22.0, None, False),
])  # fmt: skip
def test_a_vtol_that_never_flies_on_its_wing_is_known(mav_type, modes, hovers):
    columns = {} if modes is None else {VTOL_MODE: Column(T[: len(modes)], np.array(modes, float))}
    assert hovers_throughout({"MAV_TYPE": (mav_type,)}, columns) is hovers
