"""Which aircraft is meant, where it goes, and where it is sampled."""

from pathlib import Path

import pytest

from beaver_ftc.aircraft import aircraft as loading
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_aircraft.derive import derivation, outline
from beaver_ftc_aircraft.derive.derivation import Source


def test_only_what_was_derived_is_written_over(tmp_path):
    source = Source("mine", Path("mine.xml"))
    assert derivation._target(source, tmp_path) == tmp_path / "mine"
    target = tmp_path / "mine"
    target.mkdir()
    for text in (None, "name: mine\n"):
        if text:
            (target / loading.FILE).write_text(text)
        with pytest.raises(BadInput, match="is there already and was not derived"):
            derivation._target(source, tmp_path)
    (target / loading.FILE).write_text(loading.first_line() + "name: mine\n")
    assert derivation._target(source, tmp_path) == target
    assert derivation._target(Source("a", Path(), target=tmp_path / "b"), None) == tmp_path / "b"
    with pytest.raises(BadInput, match=r"^mine: give --out DIR"):
        derivation._target(source, None)


def test_where_to_sample_is_read_from_a_file(tmp_path):
    path = tmp_path / "envelope.yaml"

    def read(text):
        path.write_text(text)
        return outline.read_envelope(path)

    found = read("airspeed_mps: [42, 58]\n")
    assert (found.airspeed_mps, found.alpha_deg) == ((42.0, 58.0), None)
    assert outline.read_envelope(None) == outline.EnvelopeFile()
    for key, least, most, below in (("altitude_m", 0, 15000, -0.1), ("sideslip_deg", 0.1, 45, 0)):
        assert [getattr(read(f"{key}: {value}\n"), key) for value in (least, most)] == [least, most]
        for value in (below, most + 0.1):
            with pytest.raises(BadInput, match=key):
                read(f"{key}: {value}\n")
