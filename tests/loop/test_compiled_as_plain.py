"""Compiled flights are those of plain Python, which tests/diagnosis/test_short_flights.py keeps."""

import pytest

from kept import hold
from short_flights import SCENARIOS, flown


@pytest.mark.parametrize("document", SCENARIOS, ids=lambda document: document["name"])
def test_compiled_as_in_plain_python(document):
    hold(f"diagnosis/test_short_flights/test_as_kept[{document['name']}]", flown(document))
