"""A challenge with three short hidden flights."""

import pytest

from beaver_ftc_live.challenge import folders, grading, line

SHORT = {
    "duration_s: 20": "duration_s: 1.5",
    "at_s: 8": "at_s: 1",
    "{uniform: [4, 14]}": "{uniform: [0.5, 1]}",
}


@pytest.fixture
def challenge(tmp_path, monkeypatch):
    """Its folder."""
    monkeypatch.setattr(line, "FRAME_S", 20.0)  # whatever else this machine is busy with
    monkeypatch.setattr(line, "LOAD_S", 40.0)
    folder = tmp_path / "challenge"
    folders.new(folder, 4, grading.rules())
    for path in (folder / "teacher").glob("*.yaml"):
        text = path.read_text().replace("runs: 3", "runs: 2")
        for long, short in SHORT.items():
            text = text.replace(long, short)
        path.write_text(text)
    return folder


@pytest.fixture
def graded(challenge):
    """Grades a source on the last hidden flights, as `grade` does: what became of it."""

    def grade(source, flights=1):
        (challenge / "submissions" / "ada-1.py").write_text(source)
        (submission,) = folders.submissions(challenge)
        return grading.grade_case(submission, folders.hidden_flights(challenge)[-flights:])

    return grade
