"""False alarms, delays and names: one answer for all who judge, held by hand and by whoever asks."""

import pytest

from beaver_ftc.results.model import DeclaredFault


@pytest.mark.parametrize(
    ("fault", "right", "wrong"),
    [
        (DeclaredFault("elevator", "stuck", 1.0), ["elevator"], ["flap", "unanticipated", None]),
        (DeclaredFault(None, "unanticipated", 1.0), ["unanticipated"], ["elevator", None]),
        (DeclaredFault(None, "bias", 1.0, sensor="q"), ["sensor q", "unanticipated"], ["q", "sensor p"]),
        (DeclaredFault(None, "damage", 1.0), ["unanticipated", "rudder"], ["elevator", None]),
    ],
)
def test_which_name_is_right(fault, right, wrong):
    taken = frozenset({"rudder"})
    assert all(fault.is_named_by(name, taken) for name in right)
    assert not any(fault.is_named_by(name, taken) for name in wrong)
