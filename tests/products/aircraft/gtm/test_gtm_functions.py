"""The functions that the converted model is written in, worked out by hand; JSBSim is not asked."""

from math import prod
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from beaver_ftc_aircraft.gtm import aerodynamics
from beaver_ftc_aircraft.gtm.elements import read
from beaver_ftc_aircraft.gtm.systems import _polynomial

OF = {"sum": sum, "product": prod, "min": min, "max": max}


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


@pytest.mark.parametrize(("flown_fps", "taken_fps"), [(0.5, 1.689), (100.0, 100.0710543), (1e5, 16890.0)])
def test_the_airspeed_of_the_rates_is_1_to_10000_knots(flown_fps, taken_fps):
    terms = aerodynamics._Terms()
    axes = {"alpha": np.array([-5.0, 85.0]), "beta": np.array([-45.0, 45.0])}
    aerodynamics._flow(terms, SimpleNamespace(axes=axes))
    (made,) = (one for one in terms.functions if 'name="aero/airspeed-of-rates-fps"' in one)
    body = ElementTree.tostring(ElementTree.fromstring(made)[1])
    assert worked_out(body, **{"velocities/vt-fps": flown_fps}) == pytest.approx(taken_fps)
