"""Keys at the ends of their ranges."""

import pytest

import beaver_ftc as bf


@pytest.mark.parametrize(("section", "key"), [
    ("statistical", "false_alarms_per_h"), ("statistical", "misnaming"), ("", "slowest_oscillation_rad_s"),
])  # fmt: skip
def test_the_smallest_number_that_a_key_allows_is_flown(section, key):
    smallest = {key: 5e-324}
    fdi = {section: smallest} if section else smallest | {"fault_class": "all"}
    flight = bf.fly({"name": "smallest", "duration_s": 0.1, "fdi": fdi})
    assert not flight.metrics["detection"]["detected"]
