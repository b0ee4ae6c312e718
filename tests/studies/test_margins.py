"""Margins of the whole aircraft: against the design loop, and against flights with wrong coefficients."""

import numpy as np
import pytest

from beaver_ftc.control.laws import loop_design
from beaver_ftc.control.readout import DefaultLaw
from beaver_ftc.design.engine import slipstream
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.margins import at, interpolated, outputs, over_airspeeds
from beaver_ftc.studies.margins_loop import OpenLoop, frequencies, loops
from flying import flown, scenario

OURS = {"control": {"law": "fault-tolerant"}, "uncertainty": {}}
REAL = {**OURS, "sensors": "tactical-grade", "actuators": "servo"}


@pytest.mark.parametrize(
    "loop", [loop_design.Loop(0.01, 1.0, 1.0, 1.0), loop_design.Loop(0.05, 0.2, 0.6, 1.7, 0.01, 0.3)]
)
def test_three_integrators_are_the_design_loop(loop):
    """No coupling, no aerodynamics: each axis is the loop that the gains were derived for."""
    s, G = 3.0, np.diag([-9.0, -12.0, -4.0])
    pull, learn = loop_design.corrections(s, loop.dt_s)
    even = np.ones(3)
    opened = OpenLoop(
        np.zeros((3, 3)), G, np.eye(3), np.zeros((3, 3)), G, even, loop.approach * even,
        loop.delay_s * even, loop.keep * even, loop.dt_s,
        s * even, pull * even, learn * even, np.linalg.inv(G), loop.lead * even, loop.share,
    )  # fmt: skip
    omega = frequencies(loop.dt_s)
    expected = loop_design.open_loop(loop, s, np.exp(1j * omega * loop.dt_s))
    for axis in range(3):
        np.testing.assert_allclose(loops(opened, omega)[:, axis], expected, rtol=1e-9)


@pytest.mark.parametrize("given", [OURS, REAL], ids=["ideal", "real"])
def test_every_loop_over_the_envelope_keeps_what_is_asked(given):
    found = over_airspeeds(scenario(**given))
    assert {each.surface for each in found} == {"aileron", "elevator", "rudder", "flap"}
    assert len({each.airspeed_mps for each in found}) == 5
    assert [each for each in found if not each.keeps(6.0, 45.0)] == []


def test_pitch_has_the_gains_of_both_surfaces_by_the_share_that_is_handed_over():
    tables = np.random.default_rng(0).uniform(0.1, 5.0, (3, 4, 3))
    law = DefaultLaw([500.0, 800.0, 1200.0], *tables, np.ones(4), 1.0)
    at_800 = tables[:, :, 1]
    pitch = 0.75 * at_800[:, 1] + 0.25 * at_800[:, 3]
    expected = np.column_stack((at_800[:, 0], pitch, at_800[:, 2]))
    np.testing.assert_allclose(interpolated(law, 800.0, 0.25), expected, rtol=1e-12)


def test_the_slipstream_falls_with_airspeed_as_by_its_equation():
    lower, dpt, higher = (slipstream(160.0, 1.0, V) for V in (44.99, 45.0, 45.01))
    C = outputs((*"pqr", "alpha", "beta", "airspeed"), np.array([0.0, 0.0, 45.0, 1012.5, dpt]))
    assert C[-1, -1] == pytest.approx((higher - lower) / 0.02, rel=1e-6)


def test_a_law_that_has_no_such_loop_is_refused():
    with pytest.raises(BadInput, match="allowed: fault-tolerant, oracle"):
        over_airspeeds(scenario(control={"law": "nominal"}))


@pytest.mark.parametrize(("share", "steady"), [(0.85, True), (1.2, False)])
def test_an_elevator_so_much_stronger_is_where_the_flight_begins_to_shake(share, steady):
    """The gain margin, flown: the truth's elevator is stronger than the law believes by a share of it."""
    healthy = next(m for m in at(scenario(**REAL)) if (m.fault, m.surface) == ("none", "elevator"))
    factor = share * 10.0 ** (healthy.up_db / 20.0)
    wrong = {"coefficients": {"Cm_de": factor}}
    given = {**REAL, "sensors": "ideal", "uncertainty": wrong, "fdi": {"scheme": "none"}}
    _flight, log = flown(duration_s=6, **given)
    speed = np.abs(np.diff(log["elevator_pos_rad"][300:])).mean() / 0.01
    assert (np.degrees(speed) < 5.0) == steady
