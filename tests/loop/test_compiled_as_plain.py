"""Compiled flights are those of plain Python, which tests/diagnosis/test_short_flights.py keeps."""

import pytest

from kept import differences
from short_flights import SCENARIOS, flown


@pytest.mark.parametrize("document", SCENARIOS, ids=lambda document: document["name"])
def test_compiled_as_in_plain_python(document):
    name = f"diagnosis/test_short_flights/test_as_kept[{document['name']}]"
    assert not differences(name, flown(document))
