"""The pages of recorded flights: what their pictures show, what they say, when one is not written over."""

import numpy as np
import pytest
from pyarrow import parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import fitting, pages
from beaver_ftc_logs.findings import verdict_document
from beaver_ftc_logs.fitting import FitPart, fit_order, fit_parts
from beaver_ftc_logs.identification import regressor_names
from beaver_ftc_logs.samples import Samples
from kept import page, picture
from products.logs import small

MODEL = small.model(settings={"alarm": 0.9})
TAIL = small.model(small.TAIL)
SOUND, HALF = ("", [1.0, 1.0]), ("left", [1.0, 0.5])


@pytest.fixture(scope="module")
def flown():
    """30 s, half of them with an alarm in the middle and one at the end."""
    rows = small.rows([(20, *SOUND), (15, *HALF), (15, *SOUND), (10, "right+left", [0.2, 0.4])], step_s=0.3)
    return small.flight(MODEL, 300, lost=((1, 40, 120, 0.5),)), rows


def test_a_flight_in_a_picture(changed, flown):
    samples, rows = flown
    figure = pages.flight_figure(samples, list(MODEL.vehicle.surfaces), rows)
    assert not changed(picture(figure))


def test_an_alarm_from_the_first_row_is_shaded_from_there(changed, flown):
    samples, _ = flown
    rows = small.rows([(5, *HALF), (5, *SOUND)])
    figure = pages.flight_figure(samples, list(MODEL.vehicle.surfaces), rows)
    spans = [patch.get_extents().transformed(axis.transData.inverted())
             for axis in figure.axes for patch in axis.patches]  # fmt: skip
    assert [(span.x0, span.x1) for span in spans] == [pytest.approx((10.0, 12.5))] * 5


def test_a_spike_of_the_rates_does_not_flatten_the_flight(flown):
    """Of 20000 numbers 12 may be anything; slow rates still have a scale of 1 deg/s."""
    samples = small.flight(MODEL, 40)
    rates = np.full((20000 // 3, 3), np.deg2rad(10.0))
    rates[:4] = 100.0
    t_s = np.linspace(0.0, 10.0, len(rates))
    commands = np.zeros((len(rates), 2))
    for size, limit in ((1.0, 13.0), (0.001, 1.0)):
        spiked = changed(samples, rates=rates * size, t_s=t_s, commands=commands)
        figure = pages.flight_figure(spiked, list(MODEL.vehicle.surfaces), flown[1])
        assert figure.axes[0].get_ylim() == pytest.approx((-limit, limit))


def changed(samples, **changes):
    return Samples(**(vars(samples) | changes))


@pytest.mark.parametrize(("count", "drawn"), [(6000, 6000), (11999, 11999), (12000, 6000), (18002, 6001)])
def test_a_long_flight_is_drawn_by_every_so_many_points(flown, count, drawn):
    t_s = np.arange(count) / 10.0
    values = np.zeros((count, 3))
    long = changed(flown[0], t_s=t_s, rates=values, commands=values[:, :2])
    rows = small.rows([(count, *SOUND)])
    figure = pages.flight_figure(long, list(MODEL.vehicle.surfaces), rows)
    assert {len(line.get_xdata()) for axis in figure.axes for line in axis.lines} == {drawn}


CASES = {
    "two": [(20, *SOUND), (15, *HALF), (15, *SOUND), (10, "right+left", [0.2, 0.4])],
    "none": [(9, *SOUND)],
    "one of them brief": [(5, *SOUND), (2, *HALF), (5, *SOUND), (9, *HALF)],
    "two of them brief": [(2, *HALF), (5, *SOUND), (2, *HALF), (5, *SOUND), (9, *HALF)],
}


@pytest.mark.parametrize("name", CASES)
def test_the_page_of_a_flight(changed, monkeypatch, flown, name):
    monkeypatch.setattr(pages, "_encode_png", lambda figure: "QQ==")
    samples, rows = flown[0], small.rows(CASES[name])
    verdict = verdict_document(samples, MODEL, rows) | (
        {"score": {"classes": 0.98765, "rows": 4}} if name == "two" else {}
    )
    assert not changed(page(pages.render_diagnosis(samples, MODEL, rows, verdict)))


def test_the_page_of_a_flight_with_gaps_and_surfaces_together(changed, monkeypatch):
    monkeypatch.setattr(pages, "_encode_png", lambda figure: "QQ==")
    ages = {"roll": 0.126, "pitch": 0.05}
    samples = small.flight(TAIL, gap=100, held_age_s=ages, notes=("a < remark",), name="a & b")
    rows = small.rows([(20, "", [1.0] * 3), (20, "left_aileron+right_aileron", [0.5, 1.0, 0.5])], 3)
    assert not changed(
        page(pages.render_diagnosis(samples, TAIL, rows, verdict_document(samples, TAIL, rows)))
    )


@pytest.mark.parametrize(("share", "says"), [
    (0.876, "No fault shows in 30 s."), (0.1, "No fault shows in 30 s."), (0.099, "No verdict on 30 s."),
])  # fmt: skip
def test_a_page_says_where_nothing_is_said_and_why(monkeypatch, flown, share, says):
    monkeypatch.setattr(pages, "_encode_png", lambda figure: "QQ==")
    samples, rows = flown[0], small.rows(CASES["none"])
    reasons = [{"says": "a rate is <odd>", "share": 0.1234}, {"says": "p stands still", "share": 0.0321}]
    verdict = verdict_document(samples, MODEL, rows) | {"credible": {"share": share, "reasons": reasons}}
    text = " ".join(pages.render_diagnosis(samples, MODEL, rows, verdict).split())
    assert f'<p class="verdict">{says}</p>' in text
    assert f"Credible in {100 * share:.1f} % of the rows. In the others nothing is said:</p>" in text
    assert (
        "<li>a rate is &lt;odd&gt;: 12.3 % of the rows</li><li>p stands still: 3.2 % of the rows</li>" in text
    )
    sure = verdict_document(samples, MODEL, rows)
    assert "Credible in" not in pages.render_diagnosis(samples, MODEL, rows, sure)


def test_a_picture_is_in_the_page(flown):
    import base64

    import matplotlib.image

    samples, rows = flown
    text = pages.render_diagnosis(samples, MODEL, rows, verdict_document(samples, MODEL, rows))
    encoded = text.partition("data:image/png;base64,")[2].partition('"')[0]
    from io import BytesIO

    assert matplotlib.image.imread(BytesIO(base64.b64decode(encoded))).shape[1] == 11 * 110


def test_the_columns_of_a_diagnosis(tmp_path, monkeypatch, flown):
    monkeypatch.setattr(pages, "render_diagnosis", lambda *given: "<p>page</p>")
    samples, rows = flown
    assert pages.write_diagnosis(tmp_path, samples, MODEL, rows, {"faulty": True}) == tmp_path / "small"
    table = parquet.read_table(tmp_path / "small" / "diagnosis.parquet").to_pydict()
    expected = {"t_s": rows.t_s, "faulty": rows.faulty, "named": rows.isolated_surfaces}
    for i, surface in enumerate(("right", "left")):
        its = {
            "effectiveness": rows.effectiveness,
            "low": rows.effectiveness_low,
            "high": rows.effectiveness_high,
        }
        expected |= {f"{surface}_{what}": values[:, i] for what, values in its.items()}
    expected["fault_probability"] = rows.fault_probability
    expected["credible"] = [1] * len(rows.t_s)
    assert list(table) == list(expected)
    for name, values in expected.items():
        assert table[name] == list(values)
    assert (tmp_path / "small" / "report.html").read_text() == "<p>page</p>"
    assert (tmp_path / "small" / "verdict.json").read_text().startswith('{\n  "faulty": true')
    pages.write_results(tmp_path, "bare", {"t_s": [1.0]}, {})
    assert {path.name for path in (tmp_path / "bare").iterdir()} == {"diagnosis.parquet", "verdict.json"}
    extra = pages.write_results(tmp_path, "more", {"t_s": [1.0]}, {}, None, lambda at: (at / "extra").touch())
    assert {path.name for path in extra.iterdir()} == {"diagnosis.parquet", "verdict.json", "extra"}
    assert {path.name for path in tmp_path.iterdir()} == {"small", "bare", "more"}


def test_only_a_page_of_ours_is_written_over(tmp_path):
    path = tmp_path / "page.html"
    pages.refuse_foreign_file(path)  # there is none
    head = "<html>"
    for before, ours in (
        (0, True),
        (2000 - len(pages.PAGE_MARK), True),
        (2001 - len(pages.PAGE_MARK), False),
    ):
        path.write_text((head + " " * before)[:before] + pages.PAGE_MARK + " " * 5000)
        if ours:
            pages.refuse_foreign_file(path)
        else:
            with pytest.raises(BadInput, match="it is no page of `identify`, allowed: another --out"):
                pages.refuse_foreign_file(path)
    with pytest.raises(BadInput, match="will not replace"):
        pages.refuse_foreign_file(tmp_path)


IDENTIFIED = {
    "flights": [{"name": "one", "samples": 250, "of": 300, "notes": []}],
    "tests": [
        {
            "left_out": "second half", "samples": 120, "explained": {"p": 0.91, "q": 0.92, "r": 0.93},
            "residual_rad_s": {"p": 0.011, "q": 0.012, "r": 0.013},
            "score": {"classes": 0.9871, "mean_error": 0.0123},
        },
        {"left_out": "first half", "samples": 0},
    ],
    "collinear": [{"regressor": "p[-1]", "inflation": 23.4}],
    "colour": {"p": 1.1, "q": 1.2, "r": 1.3},
    "spectrum": [{"from_hz": 0.0, "to_hz": 0.1, "p": 0.9, "q": 1.0, "r": 1.1}],
    "output_error": {
        "windows": 40, "servo_lag_s": 0.12, "servo_lag_sd_s": 0.01, "delay_s": 0.05, "delay_sd_s": 0.02,
        "shorter_than_can_be_told": False,
        "explained_of_windows_not_fitted": {"p": 0.81, "q": 0.82, "r": 0.83},
    },
}  # fmt: skip


def test_the_page_of_an_identification(changed, monkeypatch):
    """Of one flight of a wing, with all that can be said; of two of a tail, with little."""
    monkeypatch.setattr(pages, "_encode_png", lambda figure: "QQ==")
    wing = small.model(identified=IDENTIFIED)
    assert not changed(page(pages.render_identification([small.flight(wing, 500)], wing)), part="wing")
    short = IDENTIFIED["output_error"] | {"shorter_than_can_be_told": True}
    found = IDENTIFIED | {"flights": IDENTIFIED["flights"] * 2, "collinear": [], "output_error": {}}
    tail = small.model(small.TAIL, identified=found)
    flights = [small.flight(tail, 300, name=name, seed=seed) for seed, name in enumerate("ab")]
    assert not changed(page(pages.render_identification(flights, tail)), part="tail")
    lagless = pages.render_identification(
        flights, small.model(small.TAIL, identified=found | {"output_error": short})
    )
    assert "Servo lag shorter than this rate can tell" in lagless


def test_the_pictures_of_an_identification(changed):
    model = small.model(identified=IDENTIFIED)
    usable_flights = fit_parts([small.flight(model, 900, lost=((1, 300, 400, 0.5),))])
    fits = pages._prediction_figure(usable_flights, model)
    assert not changed(picture(fits), part="fits")
    assert [axis.get_legend()._ncols for axis in fits.axes if axis.get_legend()] == [3, 3]
    spectrum = pages._spectrum_figure(usable_flights, model)
    assert not changed(picture(spectrum), part="spectrum")
    fit = fit_order(usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags)
    names = ["constant", *regressor_names(model)]
    correlation = pages._correlation_figure(fit, names)
    assert not changed(picture(correlation), part="correlation")


def test_parts_of_which_nothing_is_known_are_not_drawn():
    """Of five flights, the second without a label, three are shown; of none the page stays."""
    model = small.model()
    flights = [small.flight(model, 200, name=name, seed=seed) for seed, name in enumerate("abcde")]
    flights[1] = changed(flights[1], labels=np.full_like(flights[1].labels, np.nan),
                         logged_failures=small.FAILURE[:1], t_s=flights[1].t_s + 100.0)  # fmt: skip
    figure = pages._prediction_figure(fit_parts(flights), model)
    titles = [axis.get_title(loc="left") for axis in figure.axes]
    assert [title for title in titles if title] == [f"{name}, not fitted: one sample ahead" for name in "acd"]


@pytest.mark.parametrize(("known", "shown"), [((), 0), ((1,), 1)])
def test_a_picture_of_one_part_or_none(known, shown):
    model = small.model()
    flights = [small.flight(model, 200, name=str(seed), seed=seed) for seed in (1, 2)]
    fitted, kept_part = fit_parts(flights)
    part = FitPart(kept_part.samples, kept_part.is_usable if known else np.zeros(200, dtype=bool))
    nothing = FitPart(fitted.samples, np.zeros(200, dtype=bool))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            fitting,
            "validation_folds",
            lambda usable_flights: [([fitted], part, "one"), ([fitted], nothing, "two")],
        )
        figure = pages._prediction_figure([fitted, part], model)
    assert figure.get_size_inches().tolist() == pytest.approx([11, 4.6])
    assert len(figure.axes) == 3 * shown


def test_the_liveliest_window():
    """Of rates known at these rows; the first of two alike; from the start where all fits in it."""
    rates = np.zeros((12, 3))
    rates[[2, 3, 8, 9]] = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]
    rates[6] = np.nan
    known = np.array([0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11])
    assert pages._liveliest_row(rates, known, 2) == 8
    assert pages._liveliest_row(rates, known[:6], 2) == 2
    assert pages._liveliest_row(rates, known, 3) == 7
    assert pages._liveliest_row(rates, known, 11) == 0
    assert pages._liveliest_row(rates, known, 12) == 0
    assert pages._liveliest_row(rates[1:], known[:-1] - 0, 10) == 0


def test_a_prediction_is_shown_over_forty_seconds():
    """Of a part that lasts 60: the 40 s in which the rates known move most."""
    model = small.model()
    samples = small.flight(model, 1200, lost=())
    samples.rates[150:200] *= 5.0
    figure = pages._prediction_figure(fit_parts([samples]), model)
    axis = figure.axes[0]
    t_s = axis.lines[0].get_xdata()
    assert t_s[-1] - t_s[0] <= 40.0 + 1e-9
    assert len(t_s) == 400


def test_no_line_is_drawn_over_what_is_not_known():
    """Around both edges of a label 1.5 s are not; before them and after are."""
    model = small.model()
    samples = small.flight(model, 900, lost=((1, 300, 400, 0.5),))
    usable_flights = fit_parts([samples])
    second = pages._prediction_figure(usable_flights, model).axes[3]
    assert "first half" in second.get_title(loc="left")
    for line in second.lines:
        t_s, values = (np.asarray(data) for data in line.get_data())
        edge = ((t_s > 28.45) & (t_s < 31.45)) | ((t_s > 38.45) & (t_s < 41.45))
        assert edge.any()
        np.testing.assert_array_equal(np.isnan(values), edge | (t_s < 0.6))


def test_a_spectrum_has_lines_within_the_decades_too():
    flights = [small.flight(small.model(), 600)]
    figure = pages._spectrum_figure(fit_parts(flights), small.model())
    ((axis,), fine) = figure.axes, figure.axes[0].xaxis.get_minor_ticks()
    assert axis.get_xscale() == "log"
    assert fine
    assert all(tick.gridline.get_visible() for tick in fine)
