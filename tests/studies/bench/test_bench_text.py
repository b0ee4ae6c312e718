"""What `bench` prints, of figures that all differ."""

from beaver_ftc.studies.bench import measure as text


def timing(name, middle, ratio=None):
    told = {name: middle, f"{name}_quartiles": [middle - 0.5, middle + 0.25]}
    return told if ratio is None else told | {"ratio": ratio}


def phase(shift):
    return {
        **timing("bare_us", 10.0 + shift), **timing("closed_loop_us", 12.0 + shift, 1.2),
        "parts": {"diagnosis": timing("us", 11.0 + shift, 1.1) | {"adds_us": -1.5}},
    }  # fmt: skip


PARTS = {"set-up": 1.5, "a very long part": 2.5}
KIND = {"parts_ms": PARTS, "bare_ms": 3.5, "frames_ratio": 4.5, "flight_ratio": 5.5, "own_part_us": 6.5}
DOCUMENT = {
    "machine": {"processor": "a processor", "cores": 2, "python": "3.12", "jsbsim": "1.2"},
    "rounds": 5, "frames_a_round": 100, **phase(0.0), "before_alarm": phase(20.0),
    "alternatives": {"python_law": timing("us", 50.0, 5.0)},
    "whole_flight": {
        "frames": 1500, **timing("bare_us", 1.0), **timing("closed_loop_us", 2.0, 2.0),
        **timing("with_log_file_us", 3.0), "with_log_file_ratio": 3.0,
    },
    "sweep_flights": {"published": KIND, "other": {**KIND, "bare_ms": 7.5}},
}  # fmt: skip


def line(what, middle, ratio):
    return f"{what:42}{middle:9.3f}  [{middle - 0.5:.3f}, {middle + 0.25:.3f}]{ratio:9.3f} x"


def test_the_figures_stand_where_their_names_say():
    lines = text.text_of(DOCUMENT).splitlines()
    assert lines[0] == "a processor, 2 cores, Python 3.12, JSBSim 1.2"
    assert lines[1] == "us a frame: medians [quartiles] over 5 rounds of 100 frames"
    assert lines[4:7] == [
        line("bare aircraft", 10.0, 1.0), line("  + diagnosis", 11.0, 1.1) + "    -1.500",
        line("closed loop", 12.0, 1.2),
    ]  # fmt: skip
    assert lines[9:12] == [
        line("bare aircraft", 30.0, 1.0), line("  + diagnosis", 31.0, 1.1) + "    -1.500",
        line("closed loop", 32.0, 1.2),
    ]  # fmt: skip
    assert lines[14] == line("a law in Python plugged in", 50.0, 5.0)
    assert lines[16:20] == [
        "whole flights of 1500 frames, loading and trim included", line("bare aircraft", 1.0, 1.0),
        line("closed loop", 2.0, 2.0), line("with a log file", 3.0, 3.0),
    ]  # fmt: skip


def test_a_kind_of_flight_is_a_row_under_the_names_of_its_parts():
    head, *rows = text._kinds(DOCUMENT["sweep_flights"])[1:]
    names = [*PARTS, "frames alone", "frames, x", "flight, x", "us added a frame"]
    ends = [head.index(name) + len(name) for name in names]
    assert head.startswith(" " * 34)
    for row, bare in zip(rows, (3.5, 7.5), strict=True):
        assert [row[:end].split()[-1] for end in ends] == [
            f"{x:.3f}" for x in (*PARTS.values(), bare, 4.5, 5.5, 6.5)
        ]
        assert len(row) == len(head) == ends[-1]
    assert [row.split()[0] for row in rows] == ["published", "other"]
    assert ends[0] == 32 + 8 + 2
    assert ends[1] == ends[0] + len("a very long part") + 2
