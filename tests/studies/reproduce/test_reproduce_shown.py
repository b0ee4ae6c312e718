"""The reproduction's document and pages: the published flights, and numbers made up for other settings."""

import numpy as np
import pytest

from beaver_ftc.studies.reproduce import reproduction, words
from beaver_ftc.studies.reproduce.cases import BEYOND, VARIANTS
from beaver_ftc.studies.reproduce.claims import MEASURED
from beaver_ftc.studies.reproduce.published_figures import FIGURES
from kept import page

TESTED = [i for i, c in enumerate(MEASURED) if c.testable and not c.because and not c.measure.at_least]
AS_WELL, NOT_THERE, AT_GAIN, AS_WELL_THERE = TESTED[:4]


@pytest.fixture(scope="module")
def document():
    """Statements that hold everywhere, but for a few, and fail without their mechanism, but for one."""
    well = [c.limit * (2.0 if c.measure.at_least else 0.5) for c in MEASURED]
    ill = [-1.0 if c.measure.at_least else 2.0 * c.limit + 1.0 for c in MEASURED]
    rows = {setting.name: [*well, *ill, 3.0] for setting in reproduction.SETTINGS}
    for row in rows.values():
        row[len(MEASURED) + AS_WELL] = well[AS_WELL]
    rows[VARIANTS[3].name][NOT_THERE], rows[BEYOND[5].name][0] = np.inf, 0.15
    rows["control network_gain halved"][AT_GAIN] = np.inf
    rows["no integral action"][len(MEASURED) + AS_WELL_THERE] = well[AS_WELL_THERE]
    alarms = [[float(i in (3, 30, 31))] for i in range(54)]
    found = reproduction.document_of(reproduction.fly_published(), [*rows.values(), *alarms])
    return found | {"versions": {"ours": "1"}}


def test_the_document_and_its_pages(document, changed, tmp_path):
    said = ("counts", "testable", "construction", "background", "adaptation", "claims", "ablations", "gains")
    assert not changed({key: document[key] for key in said})
    missed = [(row["variant"], row["missed"]) for row in document["sensitivity"] if row["missed"]]
    assert not changed(missed, "variants")
    assert not changed(words.as_text(document, "out").splitlines(), "text")
    (tmp_path / "figures").mkdir()
    for name in (*(view.name for view, _, _ in FIGURES), "sensitivity"):
        (tmp_path / "figures" / f"{name}.png").write_bytes(name.encode())
    assert not changed(page(words.as_html(document, tmp_path)), "page")
    text = words.as_markdown(document, "pictures")
    assert text.count("](pictures/") == len(FIGURES) + 1
    assert text.startswith("# ")
