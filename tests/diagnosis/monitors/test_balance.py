"""What engines that are not alike yaw by when all levers are: by hand, to the right positive."""

from types import SimpleNamespace

import pytest

from beaver_ftc.diagnosis import monitors
from telling import apart

ENGINES = {"one": (0.2, -5.0), "two": (0.5, 1.5), "three": (0.3, 4.0)}  # share of the thrust; right_m


@pytest.mark.parametrize(("named", "arm"), [(("one", "two", "three"), -0.95), (("two",), -0.75)])
def test_thrust_on_the_right_turns_the_nose_to_the_left(named, arm):
    """-sum of share times arm, over the span: -( -1.0 + 0.75 + 1.2) / 12."""
    apart(engines=list(ENGINES.values()))
    effectors = {name: SimpleNamespace(share=ENGINES[name][0], right_m=ENGINES[name][1]) for name in named}
    aircraft = SimpleNamespace(effectors=effectors, geometry=SimpleNamespace(span_m=12.0, chord_m=2.0))
    assert monitors.healthy_yawing_moment_per_thrust(aircraft) == pytest.approx(arm / 12.0)
