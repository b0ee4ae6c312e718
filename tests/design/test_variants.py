"""Design models wrong on purpose: what the compiled loop evaluates against the model they simplify."""

import numpy as np
import pytest

from beaver_ftc.design.model import anchor, design_of, design_record, jacobian, response
from beaver_ftc.scenario.schema import DesignModel

X0, Y0 = np.array([0.02, -0.03, 0.01]), np.array([0.14, -0.014, 45.0, 1036.0, 2.4])
U0 = np.array([0.01, -0.05, -0.04, 0.1])


def believed(design, x, y, u=U0):
    f, G = np.zeros(3), np.zeros((3, 4))
    response(design, x, y, f, G)
    return f + G @ u


def anchored(**keys):
    design = design_of(DesignModel(**keys)).view(np.recarray)[0]
    anchor(design, X0, Y0, U0)
    return design


EXACT = design_record().view(np.recarray)[0]


def test_linearised_agrees_at_trim_and_its_error_falls_with_the_square_of_the_distance():
    linear = anchored(linearised=True)
    dx, dy, du = (
        np.array([0.1, 0.1, 0.1]),
        np.array([0.05, 0.05, 4.0, 80.0, 0.4]),
        np.array([0.1, 0.1, 0.1, 0.1]),
    )
    assert believed(linear, X0, Y0) == pytest.approx(believed(EXACT, X0, Y0), abs=1e-14)
    errors = [
        np.abs(believed(linear, X0 + s * dx, Y0 + s * dy, U0 + s * du)
               - believed(EXACT, X0 + s * dx, Y0 + s * dy, U0 + s * du))
        for s in (1e-2, 1e-3)
    ]  # fmt: skip
    assert errors[0] == pytest.approx(100 * errors[1], rel=0.1)
    assert (errors[0] > 1e-7).all()


def test_frozen_alpha_does_not_see_alpha_and_sees_all_else():
    frozen = anchored(frozen_alpha=True)
    moved = Y0 + np.array([0.1, 0.0, 0.0, 0.0, 0.0])
    assert np.array_equal(believed(frozen, X0, moved), believed(frozen, X0, Y0))
    assert believed(frozen, X0, moved) != pytest.approx(believed(EXACT, X0, moved), abs=1e-3)
    faster = Y0 * [1.0, 1.3, 1.1, 1.2, 0.8]
    assert believed(frozen, X0 + 0.1, faster) == pytest.approx(believed(EXACT, X0 + 0.1, faster), rel=1e-14)


def test_a_heavier_aircraft_of_the_same_shape_turns_slower_in_proportion():
    still = np.zeros(3)
    heavy = believed(anchored(mass=1.25), still, Y0)
    assert heavy == pytest.approx(believed(EXACT, still, Y0) / 1.25, rel=1e-13)


def test_inertia_about_one_axis_slows_that_axis():
    """With Jxz = 0 the axes are apart: pdot = L / Ix."""
    apart = {"Jxz": 0.0}
    plain, slow = anchored(inertia=apart), anchored(inertia={"Ix": 2.0, **apart})
    still = np.zeros(3)
    ratio = believed(slow, still, Y0) / believed(plain, still, Y0)
    assert ratio == pytest.approx([0.5, 1.0, 1.0], rel=1e-13)


def test_another_coefficient_changes_its_term_alone():
    """Cm_alpha less by a tenth: qdot is higher by 0.1 x 0.6028 alpha qdyn S c / Iy."""
    change = believed(anchored(coefficients={"Cm_alpha": 0.9}), X0, Y0) - believed(EXACT, X0, Y0)
    assert change == pytest.approx([0.0, 0.06028 * 0.14 * 1036.0 * 23.23 * 1.5875 / 6928.93, 0.0], abs=1e-15)


def test_jacobian_agrees_with_central_differences():
    _, G, f_x, f_y = jacobian(EXACT, X0, Y0, U0)
    for slopes, steps, move in (
        (f_x, 1e-5 * np.eye(3), lambda s: (X0 + s, Y0)),
        (f_y, np.diag([1e-5, 1e-5, 1e-3, 1e-2, 1e-4]), lambda s: (X0, Y0 + s)),
    ):
        for j, step in enumerate(steps):
            difference = believed(EXACT, *move(step)) - believed(EXACT, *move(-step))
            assert slopes[:, j] == pytest.approx(difference / (2 * step[j]), rel=1e-6, abs=1e-9)
    for s in range(4):
        assert G[:, s] == pytest.approx(believed(EXACT, X0, Y0, U0 + np.eye(4)[s]) - believed(EXACT, X0, Y0))
