"""Mistakes in a folder of one's own aircraft."""

import pytest

from beaver_ftc.aircraft.loading import load as load_aircraft
from beaver_ftc.aircraft.loading import read
from beaver_ftc.documents.errors import BadInput


def test_an_aircraft_without_its_model_is_bad_input(tmp_path):
    lines = (load_aircraft("beaver").folder / "aircraft.yaml").read_text().splitlines()
    (tmp_path / "aircraft.yaml").write_text("\n".join(lines))
    at = next(i for i, line in enumerate(lines, 1) if line.startswith("jsbsim:"))
    with pytest.raises(
        BadInput, match=rf"aircraft.yaml:{at}: jsbsim: 'beaver.xml' is not there, allowed: a file"
    ):
        read(tmp_path)
