"""From the rows of flights to the document of the matrix: its cells, and counts over all flights."""

from collections.abc import Sequence

from beaver_ftc.results.model import Document
from beaver_ftc.studies.matrix.matrix_shown import VERDICTS
from beaver_ftc.studies.present.tables import grouped, known_values, sum_of, values_of

NAMED = ("surface", "named")  # verdicts with the right surface
LIKELY = 0.5  # above this probability, a fault counts as detected by the informed test

Rows = Sequence[Document]  # rows of flights


def document_of(rows: Rows) -> Document:
    """The document of the matrix: cells, flights, those with the verdict WRONG, false alarms (which are among
    them), and aircraft that only our law lost."""
    wrong = values_of(rows, "verdict").count("WRONG")
    false_alarms = sum_of(rows, "false_alarm")
    informed = [row for row in rows if "told_chance" in row]
    return {
        "aircraft": rows[0].get("aircraft"),
        "cells": [
            _cell(fault, surface, flights)
            for (fault, surface), flights in grouped(rows, "fault", "surface").items()
        ],
        "flights": rows,
        "wrong": wrong,
        "false_alarms": false_alarms,
        "lost_though_the_oracle_was_not": [row for row in _lost(rows) if row["oracle_departure_s"] is None],
        "passed": not wrong and not false_alarms,
        **({"told": informed_counts(informed)} if informed else {}),
    }


def _cell(fault: str, surface: str, flights: Rows) -> Document:
    """The worst results of a fault on a surface over the airspeeds, and numbers of flights. delay_s: None if
    one flight has no delay."""
    delays = values_of(flights, "delay_s")
    cell = {
        "fault": fault,
        "surface": surface,
        "verdict": min(values_of(flights, "verdict"), key=VERDICTS.index),
        "delay_s": None if None in delays else max(delays),
        "candidates": sorted(set().union(*values_of(flights, "candidates"))),
        "ratio": max(known_values(flights, "ratio"), default=None),
        "lost": len(_lost(flights)),
        "oracle_lost": len(known_values(flights, "oracle_departure_s")),
        "flights": len(flights),
        "remark": _remark(flights),
    }
    return cell | ({"told": len(_detectable(flights))} if "told_chance" in flights[0] else {})


def informed_counts(rows: Rows) -> Document:
    """The results of the flights in which the informed test detects the fault with a probability above
    LIKELY.

    seen: these flights. detected: those of them with an alarm, true or false. named: the right surface is
    named. type_kept: of the detected flights, those without the verdict WRONG. Of all flights: flights, and
    detected_but_not_told, those with an alarm whose fault the informed test does not detect.
    """
    seen = _detectable(rows)
    detected = [row for row in seen if row["detected"]]
    named = [row for row in seen if row["verdict"] in NAMED]
    by_surface = {
        surface: {"seen": values_of(seen, "surface").count(surface),
                  "named": values_of(named, "surface").count(surface)}
        for surface in dict.fromkeys(values_of(rows, "surface"))
    }  # fmt: skip
    return {
        "flights": len(rows),
        "seen": len(seen),
        "detected": len(detected),
        "named": len(named),
        "share": len(named) / len(seen) if seen else None,
        "type_kept": sum(row["verdict"] != "WRONG" for row in detected),
        "by_surface": by_surface,
        "detected_but_not_told": sum_of(rows, "detected") - len(detected),
    }


def _detectable(rows: Rows) -> Rows:
    """The flights in which the informed test detects the fault with a probability above LIKELY."""
    return [row for row in rows if row["told_chance"] > LIKELY]


def _lost(rows: Rows) -> Rows:
    """The flights in which our law loses the aircraft."""
    return [row for row in rows if row["departure_s"] is not None]


def _remark(flights: Rows) -> str:
    """How many flights lose the aircraft, and the reason; or that no flight has an alarm."""
    if lost := _lost(flights):
        oracle_lost = len(known_values(lost, "oracle_departure_s"))
        return f"lost in {len(lost)} of {len(flights)} flights, the oracle in {oracle_lost}: {_reason(lost)}"
    if any(values_of(flights, "detected")):
        return ""
    return "no effect beyond the declared uncertainty: tracking is as before"


def _reason(lost: Rows) -> str:
    """The reason of the loss of the aircraft, from the flights of the oracle; if these show none, the signal
    that diverged in the first flight with our law."""
    beyond_s = max(values_of(lost, "oracle_beyond_s"))
    if beyond_s > 0.0:
        return f"for {beyond_s:.1f} s no deflection could hold the {lost[0]['axis']} rate"
    if left_s := known_values(lost, "oracle_left_envelope_s"):
        return f"the validated envelope was left at {min(left_s):.1f} s, the outer loops being open"
    return f"{lost[0]['departure_signal']} diverged"
