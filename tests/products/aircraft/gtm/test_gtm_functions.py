"""The functions that the converted model is written in, worked out by hand; JSBSim is not asked."""

from math import prod
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from beaver_ftc_aircraft.gtm import aerodynamics
from beaver_ftc_aircraft.gtm.elements import read
from beaver_ftc_aircraft.gtm.systems import _polynomial

OF = {
    "sum": sum, "product": prod, "min": min, "max": max, "and": all,
    "abs": lambda of: abs(of[0]), "ge": lambda of: of[0] >= of[1], "le": lambda of: of[0] <= of[1],
}  # fmt: skip


def worked_out(body, **properties):
    """What a function's element comes to."""

    def of(node):
        if node.tag in ("value", "v"):
            return float(node.text)
        if node.tag in ("property", "p"):
            return properties[node.text.strip()]
        return OF[node.tag]([of(part) for part in node])

    return of(ElementTree.fromstring(body))


@pytest.mark.parametrize("x", [-1.5, 0.4, 3.0])
def test_a_polynomial_has_coefficients_of_either_sign_and_none(x):
    found = worked_out(_polynomial([2.0, -3.0, 0.0, 5.0], read("x")), x=x)
    assert found == pytest.approx(2.0 * x**3 - 3.0 * x**2 + 5.0)


@pytest.fixture(scope="module")
def flow():
    """The body of each function of the flow, for static tables to 85 deg and 45 deg."""
    terms = aerodynamics._Terms()
    axes = {"alpha": np.array([-5.0, 20.0, 85.0]), "beta": np.array([-45.0, 0.0, 45.0])}
    aerodynamics._flow(terms, SimpleNamespace(axes=axes))
    made = map(ElementTree.fromstring, terms.functions)
    return {one.get("name"): ElementTree.tostring(one[1]) for one in made}


@pytest.mark.parametrize(("flown_fps", "taken_fps"), [(0.5, 1.689), (100.0, 100.0710543), (1e5, 16890.0)])
def test_the_airspeed_of_the_rates_is_1_to_10000_knots(flow, flown_fps, taken_fps):
    found = worked_out(flow["aero/airspeed-of-rates-fps"], **{"velocities/vt-fps": flown_fps})
    assert found == pytest.approx(taken_fps)


@pytest.mark.parametrize(
    ("alpha", "beta", "inside"),
    [(-5.0, 45.0, True), (85.0, -45.0, True), (-5.1, 3.0, False), (85.1, 3.0, False), (7.0, 45.1, False),
     (7.0, -45.1, False)],
)  # fmt: skip
def test_the_static_tables_end_at_both_alphas_and_at_either_sideslip(flow, alpha, beta, inside):
    angles = {"aero/alpha-deg": alpha, "aero/beta-deg": beta}
    assert worked_out(flow["aero/envelope-valid"], **angles) is inside
    assert worked_out(flow["aero/beta-mirrored-deg"], **angles) == -beta
