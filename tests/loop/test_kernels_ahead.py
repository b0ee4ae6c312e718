"""The kernels that a flight is said to call are those that it calls, for arguments of the same types."""

import pytest

from beaver_ftc.compiled import target
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import load_scenario


@pytest.mark.parametrize("name", ["elevator-partial-loss", "elevator-loss-in-turbulence"])
def test_each_kernel_that_is_expected_is_called(name):
    if not target.borrows():
        pytest.skip("kernels are parts of others")
    loop = Loop(load_scenario(name).with_({"duration_s": 16.0}))
    expected = list(loop._kernels())
    for _ in loop.chunks():
        pass
    assert loop.frames["fdi"]["verdict"]["detected"][0] == 1
    loop.release()
    called = {(target._known[name], kinds) for name, kinds in target._found}
    missed = [each for each in expected if (each.kernel, each.kinds) not in called]
    assert [each.kernel.py_func.__name__ for each in missed] == ["fly_on"], "which Python calls"
    assert len(expected) > 10
