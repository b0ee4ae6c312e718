"""The law's readout, of a record by hand: which surface leads each axis."""

import numpy as np

from beaver_ftc.control.readout import ControlReadout


def test_the_surface_that_leads_an_axis_is_read_by_its_number():
    layout = np.dtype([("main", int, 3), ("stand_in", int), ("trim", float, 4)])
    control = np.zeros(1, [("layout", layout)])[0]
    control["layout"]["main"], control["layout"]["stand_in"] = (3, 1, 2), 4
    control["layout"]["trim"] = (0.1, -0.2, 0.3, -0.4)
    readout = ControlReadout(control)
    assert readout.main.tolist() == [3, 1, 2]
    assert readout.stand_in == 4
    assert readout.trim_rad.tolist() == [0.1, -0.2, 0.3, -0.4]
