"""The worked example of docs/explanation/certificates.md: a certificate, its numbers by hand, its check."""

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

import beaver_ftc as bf
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import beaver

SCENARIO = "elevator-partial-loss"


@cache
def _alarm() -> tuple[dict[str, Any], dict[str, Any], pd.DataFrame]:
    """The certificate, its statement of the alarm, and the log."""
    flight = bf.fly(SCENARIO)
    certificate = flight.certificate()
    return certificate, certificate["statements"][0], flight.log


def certificate_example() -> str:
    """The document with the statement of the alarm alone, a line for each field of interest."""
    certificate, statement, _ = _alarm()
    shown = {name: certificate[name] for name in ("format", "scenario", "rows", "dt_s", "instants")}
    (term,) = statement["terms"]
    lines = [f" {json.dumps(shown)[1:-1]},", ' "statements": [{']
    lines += [_line(statement, "what", "column", "frame", "theta")]
    lines += ['  "terms": [{', _line(term, "weight", "d", "first", "frame")]
    lines += [_line(term, name) for name in ("x", "F")]
    lines += [_line(term, "eta_bar").removesuffix(","), "  }],", _line(statement, "sides").removesuffix(",")]
    lines += [" }],", f' "declared": {json.dumps({"b": certificate["declared"]["b"]})}']
    return "{\n" + "\n".join(lines) + "\n}"


def _line(of: dict[str, Any], *names: str) -> str:
    return "  " + ", ".join(f'"{name}": {json.dumps(_rounded(of[name]))}' for name in names) + ","


def _rounded(value: Any) -> Any:
    """To 12 digits, in which processors agree."""
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


def certificate_by_hand() -> str:
    """The inequality of the alarm from numbers of the log, pitch axis."""
    certificate, statement, log = _alarm()
    k, dt = statement["frame"], certificate["dt_s"]
    before, now = log.q_measured_rad_s[k - 1], log.q_measured_rad_s[k]
    predicted, bound = log.q_design_rad_s2[k], log.q_eta_bar_rad_s2[k]
    measured = (now - before) / dt
    innovation = measured - predicted
    rows = (
        ("pitch rate, row before", before, "rad/s"),
        ("pitch rate, row of the alarm", now, "rad/s"),
        ("measured acceleration", measured, "rad/s²"),
        ("acceleration of the design model, $F$", predicted, "rad/s²"),
        ("innovation $\\nu$", innovation, "rad/s²"),
        ("bound $\\bar\\eta$", bound, "rad/s²"),
        ("left side, $dt\\,\\lvert\\nu\\rvert$", dt * abs(innovation), "rad/s"),
        ("right side, $dt\\,\\bar\\eta$", dt * bound, "rad/s"),
    )
    return markdown_table(("quantity", "value", "unit"), [(says, f"{x:.5g}", unit) for says, x, unit in rows])


def certificate_check() -> str:
    """What `beaver-ftc check` prints of it."""
    with TemporaryDirectory() as folder:
        for given in (("run", SCENARIO, "--certificate", "--no-report"), ("check", f"runs/{SCENARIO}")):
            run = beaver(*given, cwd=Path(folder))
            run.check_returncode()
    return run.stdout.strip()
