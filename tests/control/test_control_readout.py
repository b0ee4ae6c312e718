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


def test_the_gains_of_the_default_law_are_copies_in_their_order():
    fields = [("qdyn", float, 2), ("L_disturbance_at", float, (1, 2)), ("L_rate_at", float, (1, 2)),
              ("Kp_at", float, (1, 2)), ("lead", float, 3), ("share", float)]  # fmt: skip
    control = np.zeros(1, [("rejecting", np.dtype([("config", np.dtype(fields))]))])[0]
    law = control["rejecting"]["config"]
    given = {"qdyn": [500.0, 900.0], "Kp_at": [[2.0, 3.0]], "L_rate_at": [[0.4, 0.5]],
             "L_disturbance_at": [[6.0, 7.0]], "lead": [1.1, 1.2, 1.3], "share": 0.25}  # fmt: skip
    for name, value in given.items():
        law[name] = value
    readout = ControlReadout(control)
    schedule = readout.schedule
    assert (readout.lead.tolist(), readout.share) == ([1.1, 1.2, 1.3], 0.25)
    law["qdyn"], law["Kp_at"] = 0.0, 0.0
    assert schedule.qdyn_pa.tolist() == [500.0, 900.0]
    assert schedule.Kp.tolist() == [[2.0, 3.0]]
    assert schedule.L_rate.tolist() == [[0.4, 0.5]]
    assert schedule.L_disturbance.tolist() == [[6.0, 7.0]]
