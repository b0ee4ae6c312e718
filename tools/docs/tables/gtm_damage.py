"""What aircraft.md prints of damage: where it can be flown, what flies there, what is found of it."""

import os
import tempfile
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import yaml
from benchmarks import gtm_damage as campaign
from benchmarks import gtm_informed as informed
from matplotlib.figure import Figure

import beaver_ftc as bf
from beaver_ftc.documents.files import read_json
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_aircraft.gtm.conversion import convert
from beaver_ftc_aircraft.gtm.parameters import cases
from beaver_ftc_aircraft.gtm.steady import Bench
from tools.docs.tables import beaver, picture, table_of
from tools.gtm.envelope import BANKS_DEG, SIDESLIPS_DEG, SPEEDS_KT, Envelope, Turn
from tools.gtm.specification import DATABASE

LAWS = ("fault-tolerant", "oracle", "nominal")
FLIGHTS, CALM = 600, 120
OURS_AND_PAGE = (
    "Our diagnosis and Page's test in the flights of Table 6. Columns as explained above; numbers of flights."
)
SWEEP = Path(__file__).parents[3] / "examples" / "gtm" / "damaged-turns.yaml"
FLOWN_KT = (80, 95, 110)
DURATION_S, AT_S, TURN_S, TURN_DEG = 70.0, 10.0, 30.0, 15.0


@cache
def _folder() -> Path:
    """Where the aircraft folder `gtm` is, imported for these tables alone."""
    folder = Path(tempfile.mkdtemp(prefix="beaver-ftc-"))
    convert(Path(os.environ["BEAVER_FTC_GTM"]) / DATABASE, folder)
    return folder


def gtm_envelope() -> str:
    """Level turns that can be held, of each case, and flights of 60 s with it; and the picture."""
    bench = Bench(_folder() / "gtm" / "gtm.xml")
    of = {name: list(Envelope(bench, k).turns()) for k, name in enumerate(("whole", *cases()))}
    rows = []
    for name, turns in of.items():
        held = [turn for turn in turns if turn.held]
        level = [turn.speed_kt for turn in held if turn.bank_deg == 0]
        flown = ["" if name == "whole" else str(_flown(name, law)) for law in LAWS]
        rows.append([name, str(len(turns)), str(len(held)), str(min(level)), *flown])
    head = ("case", "turns tried", "turns held", "slowest level flight, kt", *LAWS)
    shown = picture("gtm-envelope.png", "Level turns held", _drawn(of), dpi=110, bbox_inches="tight")
    return f"{markdown_table(head, rows)}\n\n{shown}"


def _flown(case: str, law: str) -> int:
    """At how many speeds it is still flown 60 s after the damage: airspeed within 5 kt, bank within 5 deg."""
    kept = 0
    for knots in FLOWN_KT:
        speed_mps = knots * campaign.M_S_PER_KT
        hold = [{"hold": True}]
        given = {
            "name": "held", "aircraft": "./gtm", "duration_s": DURATION_S, "control": {"law": law},
            "initial": {"airspeed_mps": round(speed_mps, 2)},
            "autopilot": {"airspeed_mps": hold, "altitude_m": hold,
                          "bank_deg": [{"value": 0}, {"at_s": TURN_S, "value": TURN_DEG}]},
            "faults": [{"type": "damage", "case": case, "at_s": AT_S}],
        }  # fmt: skip
        path = _folder() / "held.yaml"
        path.write_text(yaml.safe_dump(given), encoding="utf-8")
        flight = bf.fly(bf.load(path))
        log, metrics = flight.log, flight.metrics
        late = log[log["t_s"] > DURATION_S - 10.0]
        bank_off = np.abs(np.degrees(late["phi_rad"]) - TURN_DEG).max()
        speed_off = np.abs(late["airspeed_mps"] - speed_mps).max() / campaign.M_S_PER_KT
        kept += bool(not metrics.get("departure") and bank_off < 5.0 and speed_off < 5.0)
    return kept


def _drawn(of: dict[str, list[Turn]]) -> Figure:
    """A panel a case: speed against bank, and how many of the sideslips asked for can be held."""
    figure, axes = plt.subplots(1, len(of), figsize=(13, 2.6), sharey=True)
    for axis, (name, turns) in zip(axes, of.items(), strict=True):
        asked = len(turns) // (len(SPEEDS_KT) * len(BANKS_DEG))
        share = np.zeros((len(SPEEDS_KT), len(BANKS_DEG)))
        for turn in turns:
            share[SPEEDS_KT.index(turn.speed_kt), BANKS_DEG.index(turn.bank_deg)] += turn.held / asked
        drawn = axis.pcolormesh(
            BANKS_DEG, SPEEDS_KT, share, cmap="cividis", vmin=0, vmax=1, shading="nearest"
        )
        for (i, j), part in np.ndenumerate(share):
            if part == 0.0:
                axis.text(
                    BANKS_DEG[j], SPEEDS_KT[i], "x", ha="center", va="center", color="white", fontsize=8
                )
        says = "sideslip not prescribed" if asked == 1 else f"{len(SIDESLIPS_DEG)} sideslips"
        axis.set_title(f"{name.replace('left-', 'left-' + chr(10), 1)}\n{says}", fontsize=7)
        axis.set_xlabel("bank, deg", fontsize=8)
        axis.set_xticks((-45, 0, 45))
        axis.tick_params(labelsize=7)
    axes[0].set_ylabel("airspeed, kt", fontsize=8)
    bar = figure.colorbar(drawn, ax=axes, fraction=0.015, pad=0.01)
    bar.set_label("share of the sideslips\nin which the turn is held\n(x: none)", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    return figure


def gtm_damage() -> str:
    """How soon damage is detected in random turns, and what is concluded."""
    return markdown_table(campaign.HEAD, [list(map(str, row)) for row in campaign.rows(_flights())])


def gtm_damage_informed() -> str:
    """The same flights by the informed test; and in calm air with exact sensors."""
    *_, calm = campaign.rows(campaign.fly_all(CALM, True, _kept() / "calm.jsonl"))
    ours = {one["k"]: one for one in _flights()}
    rows = list(informed.rows(ours, informed.see_all(ours, _kept() / "informed.jsonl")))
    head = ("case", "flights", "ours", "Page", "avoidable misses")
    return (
        f"*Table 7. {OURS_AND_PAGE}*\n\n{markdown_table(head, rows)}\n\n"
        f"With exact sensors in calm air, {calm[3]} of {calm[1]} damages are detected within 1 s, and "
        f"{calm[10]} flights end with a wrong name."
    )


def _flights() -> list[campaign.Document]:
    """The flights in turbulence.

    `BEAVER_FTC_GTM_ROWS`: a folder with rows flown before by that benchmark, which are not flown again.
    """
    return campaign.fly_all(FLIGHTS, False, _kept() / "full.jsonl")


@cache
def _kept() -> Path:
    return Path(os.environ.get("BEAVER_FTC_GTM_ROWS") or tempfile.mkdtemp(prefix="beaver-ftc-"))


def gtm_laws() -> str:
    """Our laws and the rivals on the flights of SWEEP, by `beaver-ftc compare`; made before, it is read."""
    made = _kept() / "comparisons" / f"gtm-{SWEEP.stem}" / "comparison.json"
    if not made.is_file():
        asked = ("compare", "--sweep", str(SWEEP), "--schemes", "adaptive-estimators", "--workers", "1")
        beaver(*asked, cwd=_kept()).check_returncode()
    (of,) = read_json(made)["sets"].values()
    return table_of(of["lines"], {
        "law": "law", "flights": lambda one: str(of["flights"]), "aircraft lost": "departures",
        "before damage, deg/s": "before_median .3g", "after damage, deg/s": "after_median .3g",
    })  # fmt: skip
