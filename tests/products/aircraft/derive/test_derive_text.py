"""What a derivation prints, of a document with everything in it."""

from beaver_ftc_aircraft.derive import derived
from beaver_ftc_aircraft.derive.derived import WHY_NOT_USED

DOCUMENT = {
    "aircraft": "glider", "folder": "out/glider",
    "surfaces": {"aileron": [-0.3, 0.3], "elevator": [-0.4, 0.2]},
    "terms": {"Cl": 4, "Cm": 3, "Cn": 5},
    "envelope": {"airspeed_mps": [20.0, 45.5], "alpha_deg": [-2.0, 12.0], "altitude_m": [200.0, 3000.0]},
    "largest_error_rad_s2": {
        kind: {axis: 0.01 * (3 * k + i) for i, axis in enumerate("pqr")}
        for k, kind in enumerate(("fitted", "checked", "declared"))
    }
    | {"fitted": {"p": 0.0, "q": 1.5e-5, "r": 0.00212}},
    "smallest_certain_loss": {"aileron": 0.25, "elevator": 1.0, "rudder": 2.1},
    "own_file": [{"term": "Cm_alpha", "own": -0.6123456, "found": -0.59}],
    "notes": ["no flap", "no engine"], "further_surfaces": {"spoiler": "fcs/spoiler-pos-rad", "slat": "x"},
    "took_s": 12.34, "copy_off": {"share": 0.02, "where": "2.00% in roll"},
    "files": {"Engines/motor.xml": "../../engine", "Systems/a.xml": "."},
}  # fmt: skip


def test_a_derivation_as_text():
    assert derived.text_of(DOCUMENT).splitlines() == [
        "glider: Cl 4, Cm 3, Cn 5 terms",
        " envelope   20 to 45.5 m/s, angle of attack -2 to 12 deg, altitude 200 to 3000 m",
        " surfaces   aileron, elevator",
        " largest error, rad/s2            p         q         r",
        "   states of the fit              0   1.5e-05    0.0021",
        "   states not seen             0.03      0.04      0.05",
        "   declared bound              0.06      0.07      0.08",
        " certain to be detected    jam, off  loss at 3 deg",
        "   aileron                 0.75 deg  25%",
        "   elevator                   3 deg  100%",
        "   rudder                   6.3 deg  none: a total one needs 6.3 deg",
        " coefficient                 own file       found",
        "   Cm_alpha                  -0.61235       -0.59",
        " copy       off the model by at most 2.00% in roll",
        " files      Engines/motor.xml from ../../engine, Systems/a.xml from .",
        " note: no flap",
        " note: no engine",
        f" not used: spoiler, slat: {WHY_NOT_USED}",
        " written in 12.3 s to out/glider, with a page on it, derived.md",
    ]
    none = {"own_file": None, "notes": [], "further_surfaces": {}, "copy_off": None, "files": {}}
    short = derived.text_of({**DOCUMENT, **none}).splitlines()
    assert len(short) == 12
    assert short[-1].startswith(" written in")
