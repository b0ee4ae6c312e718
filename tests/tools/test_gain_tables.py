"""How the gains of zhang2005 were chosen: the least cost wins, and the default is what wins."""

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
