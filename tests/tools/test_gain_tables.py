"""How the gains of zhang2005 were chosen: the least cost wins, and the default is what wins."""

import numpy as np
import pytest

from tools import gains


def test_the_least_is_chosen_and_a_default_that_is_not_is_said(monkeypatch, capsys):
    monkeypatch.setattr(gains, "cost", lambda gain, value: abs(value - 2.0 * gain.default))
    chosen = {gain.option: value for gain, _, value in gains.search()}
    assert chosen["rate_weight"] == 20.0  # nothing beyond is on its ladder
    with pytest.raises(SystemExit) as ended:
        gains.main()
    assert ended.value.code == 1
    assert "scheme adaptation_gain: chosen 5000, default 3000. error of theta" in capsys.readouterr().out


def test_the_fdaes_network_has_the_gain_that_the_procedure_chooses():
    gain = gains.GAINS[0]
    costs = {value: gains.cost(gain, value) for value in (70, gain.default, 200)}
    assert min(costs, key=costs.get) == gain.default


def test_a_lost_aircraft_is_no_choice():
    law = next(gain for gain in gains.GAINS if gain.option == "parametric_gain")
    assert gains.cost(law, 5000.0) == np.inf
