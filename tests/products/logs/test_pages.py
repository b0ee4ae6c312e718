"""The pages of recorded flights: what their pictures show, what they say, when one is not written over."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import pages
from beaver_ftc_logs.findings import verdict_document
from beaver_ftc_logs.identification_page import PAGE_MARK, refuse_foreign_file, render_identification
from given import given
from kept import page
from products.logs import small

GIVEN = given(__file__)

MODEL = small.model(settings={"alarm": 0.9})
SOUND, HALF = ("", [1.0, 1.0]), ("left", [1.0, 0.5])


@pytest.fixture(scope="module")
def flown():
    """30 s, half of them with an alarm in the middle and one at the end."""
    rows = small.rows([(20, *SOUND), (15, *HALF), (15, *SOUND), (10, "right+left", [0.2, 0.4])], step_s=0.3)
    return small.flight(MODEL, 300, lost=((1, 40, 120, 0.5),)), rows


def rendered(samples, rows, verdict):
    words = pages.words_of_model(MODEL)
    return pages.render_diagnosis(samples, rows, verdict, words)


@pytest.mark.parametrize(
    ("share", "says"), [(0.876, "No fault shows"), (0.1, "No fault"), (0.099, "No verdict")]
)
def test_a_page_says_where_nothing_is_said_and_why(monkeypatch, flown, share, says):
    monkeypatch.setattr(pages, "encode_png", lambda figure: "QQ==")
    samples, rows = flown[0], small.rows([(9, *SOUND)])
    reasons = [{"says": "a rate is <odd>", "share": 0.1234}, {"says": "p stands still", "share": 0.0321}]
    verdict = verdict_document(samples, MODEL, rows) | {"credible": {"share": share, "reasons": reasons}}
    text = rendered(samples, rows, verdict)
    assert f'<p class="verdict">{says}' in text
    assert "<li>a rate is &lt;odd&gt;: 12.3 % of the rows</li>" in text


def test_the_page_of_a_flight(changed, monkeypatch, flown):
    monkeypatch.setattr(pages, "encode_png", lambda figure: "QQ==")
    samples, rows = flown
    verdict = verdict_document(samples, MODEL, rows) | {"score": {"classes": 0.98765, "rows": 4}}
    assert not changed(page(rendered(samples, rows, verdict)))


def test_only_a_page_of_ours_is_written_over(tmp_path):
    path = tmp_path / "page.html"
    refuse_foreign_file(path)  # there is none
    most = 2000 - len(PAGE_MARK)
    path.write_text(" " * most + PAGE_MARK + " " * 5000)
    refuse_foreign_file(path)
    path.write_text(" " * (most + 1) + PAGE_MARK)
    with pytest.raises(BadInput, match="it is no page of `identify`, allowed: another --out"):
        refuse_foreign_file(path)
    with pytest.raises(BadInput, match="will not replace"):
        refuse_foreign_file(tmp_path)


IDENTIFIED = GIVEN["identified"]  # fmt: skip


def test_the_page_of_an_identification(changed, monkeypatch):
    """Of one flight of a wing, with all that can be said."""
    monkeypatch.setattr("beaver_ftc_logs.identification_page.encode_png", lambda figure: "QQ==")
    wing = small.model(identified=IDENTIFIED)
    assert not changed(page(render_identification([small.flight(wing, 500)], wing)))
