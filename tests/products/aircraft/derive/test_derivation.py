"""Which aircraft is meant, where it goes, and where it is sampled."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_aircraft.derive import outline


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
