"""What is kept of short flights, flown in plain Python: it says what changes, not what is right."""

import pytest

from short_flights import SCENARIOS, flown


@pytest.mark.parametrize("document", SCENARIOS, ids=lambda document: document["name"])
def test_as_kept(document, changed):
    assert not changed(flown(document))
