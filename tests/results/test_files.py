"""What lies on the disk: logs whole, sliced, damaged or too large; result folders, exchanged and refused."""

import shutil

import pytest
from synthetic import landed

import beaver_ftc as bf
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results import result_files
from beaver_ftc.results.flight import Flight as Opened
from beaver_ftc.results.folder import refuse_foreign, result_folder
from beaver_ftc.results.metrics import metrics


@pytest.mark.parametrize(
    ("name", "content", "ours"),
    [
        ("figures/tracking.png", b"x" * 2038 + b"beaver-ftc", True),
        ("figures/tracking.png", b"x" * 2039 + b"beaver-ftc" + b"x" * 2039, False),
        ("figures/tracking.pdf", b"x" * 5000 + b"beaver-ftc", True),
        ("figures/deep/tracking.png", b"beaver-ftc", False),  # a folder is no picture of ours
        ("aircraft/engine/own.xml", b"", True),
        ("aircraft/notes.txt", b"", False),
        ("metrics.json", b"", True),
    ],
)
def test_what_is_ours_may_be_replaced_and_nothing_else(tmp_path, name, content, ours):
    path = tmp_path / "case" / name
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    if ours:
        assert refuse_foreign(tmp_path / "case") is None
        return
    with pytest.raises(SimulationFailed, match=r"will not replace .*case: it holds \w+/"):
        refuse_foreign(tmp_path / "case")


def test_links_are_not_followed(tmp_path):
    (tmp_path / "picture").write_bytes(b"beaver-ftc")
    (tmp_path / "case" / "figures").mkdir(parents=True)
    for target in ("case", "nowhere"):
        link = tmp_path / f"to-{target}"
        link.symlink_to(tmp_path / target)
        with pytest.raises(SimulationFailed, match="it exists and is not a folder"):
            refuse_foreign(link)
    (tmp_path / "case" / "figures" / "a.png").symlink_to(tmp_path / "picture")
    with pytest.raises(SimulationFailed, match=r"it holds figures/a\.png"):
        refuse_foreign(tmp_path / "case")


def test_what_appears_in_its_place_meanwhile_is_not_lost(tmp_path):
    with pytest.raises(SimulationFailed, match="it holds mine"), result_folder(tmp_path, "case"):
        (tmp_path / "case" / "mine").mkdir(parents=True)
    assert [path.name for path in tmp_path.iterdir()] == ["case"]


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A scenario of the user's own aircraft, with more in its folder than a model is made of."""
    folder = tmp_path_factory.mktemp("own")
    shutil.copytree(bf.aircraft("beaver").folder, folder / "my-uav")
    (folder / "my-uav" / "notes.txt").touch()
    (folder / "mine.yaml").write_text("name: mine\naircraft: ./my-uav\nduration_s: 0.2\n")
    return bf.load(folder / "mine.yaml")


def test_an_own_aircraft_is_kept_with_its_flight(own, tmp_path):
    for _ in range(2):  # also where it lies already
        result_files.write_documents(tmp_path, own, metrics(landed()))
    files = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    model = {
        str(path.relative_to(own.airframe.folder.parent))
        for path in own.airframe.folder.rglob("*")
        if path.is_file() and path.suffix in {".xml", ".yaml"}
    }
    assert files == {"scenario.yaml", "metrics.json"} | {f.replace("my-uav", "aircraft", 1) for f in model}
    assert bf.load(tmp_path / "scenario.yaml").aircraft == "./aircraft"
    assert Opened(own, bf.open_run(tmp_path).metrics).passed is True
