"""Names in prose: those of the code, its files and commands pass; one letter more, and it is a line."""

import pytest
from tools.docs import names

SHOWN = frozenset({"MyCusum", "cusum"})
GOOD = (
    "fdi.bounds.sensors", "faults[].at_s", "q_threshold_rad_s", "<surface>_effectiveness_estimate",
    "fcs/elevator-pos-rad", "uncertainty/<term>-scale", "flight.metrics",
    "src/beaver_ftc/loop/frame.py", "beaver-ftc run elevator-partial-loss --no-report",
    "sweep FILE --workers 2", "bf.fly(scenario, detector=MyCusum())",
    "fdi: {scheme: cusum}", "test_docs_names.py",
    "estimators.narrow_sets",
)  # fmt: skip
WRONG = {
    "fdi.bounds.sensorss": "sensorss",
    "q_thresholds_rad_s": "q_thresholds_rad_s",
    "fcs/elevator-position-rads": "elevator-position-rads",
    "plant/adapters.py": "plant/adapters.py",
    "beaver-ftc rum elevator-partial-loss": "rum",
    "sweep FILE --workerss 2": "--workerss",
    "the frame calls frame_stepp of it": "frame_stepp",
    "isolation.predict": "isolation.predict",
}


@pytest.mark.parametrize("span", [*GOOD, *WRONG])
def test_a_name_of_the_project_passes_and_another_is_found(span):
    assert names.wrong(span, SHOWN) == WRONG.get(span)
