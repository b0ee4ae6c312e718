"""What the matrix amounts to: one cell a fault and surface, the worst of its airspeeds."""

from typing import Any

from beaver_ftc.studies.matrix.cases import FAULTS

Document = dict[str, Any]
NAMED = ("surface", "named")
LIKELY = 0.5  # a test that finds a fault more often than not sees it
WORST_FIRST = ("WRONG", "unseen", "open", "surface", "named")


def document_of(rows: list[Document]) -> Document:
    """The whole matrix as a document: cells, single flights, and what went wrong anywhere."""
    surfaces = list(dict.fromkeys(row["surface"] for row in rows))
    cells = [_cell(fault, surface, rows) for fault, _ in FAULTS for surface in surfaces]
    told = [row for row in rows if "told_chance" in row]
    return {
        "aircraft": next((row["aircraft"] for row in rows if "aircraft" in row), None),
        "cells": cells,
        "flights": rows,
        "wrong": sum(row["verdict"] == "WRONG" for row in rows),
        "false_alarms": sum(row["false_alarm"] for row in rows),
        "lost_though_the_oracle_was_not": [row for row in rows if _lost_alone(row)],
        "passed": not any(row["verdict"] == "WRONG" or row["false_alarm"] for row in rows),
        **({"told": beside_told(told)} if told else {}),
    }


def beside_told(rows: list[Document]) -> Document:
    """What becomes of the flights in which a test that is told the fault sees it.

    named: the right surface, whether or not its type is still open; type_kept: the right type is named or
    among the candidates.
    """
    seen = [row for row in rows if row["told_chance"] > LIKELY]
    named = sum(row["verdict"] in NAMED for row in seen)
    return {
        "flights": len(rows),
        "seen": len(seen),
        "detected": sum(row["detected"] for row in seen),
        "named": named,
        "share": named / len(seen) if seen else None,
        "type_kept": sum(row["detected"] and row["verdict"] != "WRONG" for row in seen),
        "by_surface": {
            surface: {"seen": len(of_it), "named": sum(row["verdict"] in NAMED for row in of_it)}
            for surface in dict.fromkeys(row["surface"] for row in rows)
            for of_it in [[row for row in seen if row["surface"] == surface]]
        },
        "detected_but_not_told": sum(row["detected"] and row["told_chance"] <= LIKELY for row in rows),
    }


def surfaces_of(document: Document) -> list[str]:
    """The surfaces in a matrix, in the aircraft's order."""
    return list(dict.fromkeys(cell["surface"] for cell in document["cells"]))


def _lost_alone(row: Document) -> bool:
    return row["departure_s"] is not None and row["oracle_departure_s"] is None


def _cell(fault: str, surface: str, rows: list[Document]) -> Document:
    here = [row for row in rows if (row["fault"], row["surface"]) == (fault, surface)]
    delays = [row["delay_s"] for row in here]
    ratios = [row["ratio"] for row in here if row["ratio"] is not None]
    return {
        "fault": fault,
        "surface": surface,
        "verdict": min((row["verdict"] for row in here), key=WORST_FIRST.index),
        "delay_s": None if None in delays else max(delays),
        "candidates": sorted({candidate for row in here for candidate in row["candidates"]}),
        "ratio": max(ratios, default=None),
        "lost": sum(row["departure_s"] is not None for row in here),
        "oracle_lost": sum(row["oracle_departure_s"] is not None for row in here),
        "flights": len(here),
        "remark": _remark(here),
        **({"told": sum(row["told_chance"] > LIKELY for row in here)} if "told_chance" in here[0] else {}),
    }


def _reason(lost: list[Document]) -> str:
    """Why not even the oracle kept the aircraft."""
    beyond_s = max(row["oracle_beyond_s"] for row in lost)
    if beyond_s > 0.0:
        return f"for {beyond_s:.1f} s no deflection at all could hold the {lost[0]['axis']} rate"
    left_s = [row["oracle_left_envelope_s"] for row in lost if row["oracle_left_envelope_s"] is not None]
    if left_s:
        return f"the validated envelope was left at {min(left_s):.1f} s, the outer loops being open"
    return f"{lost[0]['departure_signal']} diverged"


def _remark(here: list[Document]) -> str:
    """Why no law could keep the aircraft, where it was lost; why nothing was seen, where nothing was."""
    lost = [row for row in here if row["departure_s"] is not None]
    if lost:
        also = sum(row["oracle_departure_s"] is not None for row in lost)
        return f"lost in {len(lost)} of {len(here)} flights, the oracle in {also}: {_reason(lost)}"
    if all(not row["detected"] for row in here):
        return "no effect beyond the admitted uncertainty: tracking is as before"
    return ""
