"""What a campaign counts and prints, of rows that differ in everything."""

from beaver_ftc.studies.verify import PROMISES, SCHEMES, summarise, summary_text


def healthy(alarm=False, departed=False, outside_s=0.0, closest=(0.5, 0.75)):
    row = {"watched_s": 1800.0, "alarm": alarm, "departed": departed, "outside_s": outside_s}
    return {**row, "closest": list(closest)}


def of_scheme(**changes):
    well = {
        "delay_s": 0.1, "false_alarm": False, "guaranteed_s": 0.2, "late": False, "isolation_s": 0.3,
        "excluded": False, "wrong": False, "estimate_error": 0.01,
    }  # fmt: skip
    return well | changes


def faulty(published=None, **sharpened):
    return {"published": of_scheme(**(published or {})), "sharpened": of_scheme(**sharpened)}


ROWS = {
    "healthy": [
        healthy(outside_s=900.0),
        healthy(departed=True, closest=(0.875, 0.25)),
        {"skipped": "no trim"},
    ],
    "faulty": [
        faulty({"delay_s": 0.5, "isolation_s": None, "wrong": True}, delay_s=0.1),
        faulty({"delay_s": 0.5, "late": True}, delay_s=0.2, estimate_error=None),
        faulty({"delay_s": None}, delay_s=None, guaranteed_s=None, isolation_s=None),
    ],
}


def test_a_campaign_as_text():
    found = summarise(ROWS)
    bounds = [[s[f"{p}_probability_upper_95"] for s in found["schemes"].values()] for p in PROMISES]
    rate = found["healthy"]["false_alarms_per_hour_upper_95"]

    first, second = SCHEMES

    def line(label, *cells):
        return f"  {label:<32}" + "".join(f"{cell:>18}" for cell in cells)

    names = ["G1 false alarms", "G2 true fault exclusions", "G2 wrong isolations", "G3 late detections"]
    counts = [(0, 0), (0, 0), (1, 0), (1, 0)]
    promises = [
        line(name, *(f"{n} (p < {p:.1e})" for n, p in zip(count, bound, strict=True)))
        for name, count, bound in zip(names, counts, bounds, strict=True)
    ]
    assert summary_text(found).splitlines() == [
        "1.00 flight hours without a fault: 2 flights, 0.25 h outside the validated envelope, 1 departures",
        f"  G1 false alarms                 0 (at most {rate:.2g} per hour, 95 % confidence)",
        f"  closest approach to threshold   {first} 0.875000, {second} 0.750000",
        "",
        f"3 random faults{'':17}{first:>18}{second:>18}",
        *promises,
        line("detected", 2, 2), line("detection certain", 3, 2), line("isolated", 2, 2),
        line("detection delay, s, median", 0.5, 0.2), line("detection delay, s, p90", "never", "never"),
        line("isolation delay, s, median", 0.3, 0.3), line("isolation delay, s, p90", "never", "never"),
        line("delay / guaranteed, median", 2.5, 0.5), line("delay / guaranteed, p90", 2.5, 1),
        line("error of the estimate, median", 0.01, 0.01), line("error of the estimate, p90", 0.01, 0.01),
        "  median detection delay shorter by 60%", "",
        "1 flights drawn could not be trimmed and are not counted",
        "G1 to G3 hold for the sharpened scheme",
    ]  # fmt: skip
