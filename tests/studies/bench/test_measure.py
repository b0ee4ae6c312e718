"""What is timed, how often, and what is made of it: with clocks and contenders made by hand."""

import pytest

from beaver_ftc.studies.bench.contenders import Bare, take_over
from flying import scenario


def test_jsbsim_alone_runs_so_often_a_frame_from_the_moment_on():
    moment = take_over(scenario(duration_s=1), 0.1)
    for runs in (1, 3):
        bare = Bare(moment, runs)
        bare.prepare()
        bare.fly(4)
        assert bare.plant.read("simulation/sim-time-sec") == pytest.approx(0.01 * 4 * runs)
    Bare(moment, 1).fly(2)
    assert bare.plant.read("simulation/sim-time-sec") == pytest.approx(0.14)
