"""A stranger's aircraft folder is data: what would write, listen, connect or leave it is refused by name.

Each deed stands in a real folder, and is looked for on the machine: a file that appears, a connection that
comes in, a port that is taken.
"""

import contextlib
import shutil
import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

import beaver_ftc as bf
import needs
from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import bare
from beaver_ftc.plant.instrumented import instrument, source_of
from given import given
from trainer import TRAINER

GIVEN = given(__file__)

SCENARIO = "name: stranger\naircraft: ./trainer\nduration_s: 0.5\n"


class Machine:
    """A folder with a stranger's aircraft, a place it should not write to, and ports that are watched."""

    def __init__(self, root: Path, stack: contextlib.ExitStack) -> None:
        self.root, self.folder = root / "mine", root / "mine" / "trainer"
        shutil.copytree(TRAINER, self.folder)
        self.scenario = self.root / "stranger.yaml"
        self.scenario.write_text(SCENARIO)
        self.precious = root / "precious.csv"
        self.precious.write_text("mine\n")
        self.tcp = stack.enter_context(contextlib.closing(socket.socket()))
        self.udp = stack.enter_context(contextlib.closing(socket.socket(type=socket.SOCK_DGRAM)))
        for each in (self.tcp, self.udp):
            each.bind(("127.0.0.1", 0))
            each.setblocking(False)
        self.tcp.listen()
        with socket.socket() as free:
            free.bind(("", 0))
            self.free = free.getsockname()[1]

    def put(self, file: str, text: str) -> None:
        """Put a text into a file of the folder: a model's at its end, another file whole."""
        text = text.format(
            precious=self.precious, tcp=self.tcp.getsockname()[1], udp=self.udp.getsockname()[1],
            free=self.free,
        )  # fmt: skip
        path = self.folder / file
        if path.is_file():
            whole, end, rest = path.read_text().rpartition("</")
            text = f"{whole}{text}\n{end}{rest}"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)

    def untouched(self) -> None:
        """Nothing was written, nothing came in, nothing listens."""
        assert self.precious.read_text() == "mine\n"
        assert {path.name for path in self.root.iterdir()} <= {"trainer", "stranger.yaml"}
        with pytest.raises(BlockingIOError):
            self.tcp.accept()
        with pytest.raises(BlockingIOError):
            self.udp.recv(1)
        with socket.socket() as free:
            assert free.connect_ex(("127.0.0.1", self.free)) != 0


@pytest.fixture
def machine(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    with contextlib.ExitStack() as stack:
        yield Machine(tmp_path, stack)


def refused(*asked):
    done = CliRunner().invoke(app, list(map(str, asked)))
    said = str(done.exception) if isinstance(done.exception, BadInput) else done.stderr
    assert getattr(done.exception, "exit_code", None) == 2 or done.exit_code == 2, (asked, done.exception)
    return said


DEEDS = GIVEN["deeds"]  # fmt: skip


@needs.service("compare")
@pytest.mark.parametrize(("file", "text", "says"), DEEDS)
def test_what_acts_on_the_machine_is_refused_by_name(machine, file, text, says):
    machine.put(file, text)
    said = refused("validate", machine.scenario).splitlines()
    machine.untouched()
    assert all(line.startswith(f"{machine.folder / file}:") for line in said), said
    assert says in said[0]
    assert "allowed: " in said[0]
    number = int(said[0].removeprefix(f"{machine.folder / file}:").partition(":")[0])
    assert "<" in (machine.folder / file).read_text().splitlines()[number - 1]


NESTED = {
    "trainer.xml": '<system file="a"/>',
    "Systems/a.xml": '<system name="a"> <channel name="a" file="b"/> </system>',
    "b.xml": '<output name="{precious}" type="CSV"/>',
}


@needs.service("compare")
def test_a_file_named_by_a_file_that_is_named_is_looked_at(machine):
    for file, text in NESTED.items():
        machine.put(file, text)
    assert refused("validate", machine.scenario).startswith(f"{machine.folder}/b.xml:1: <output name=")
    machine.untouched()


@pytest.mark.parametrize(
    "asked",
    [
        ["trim", "{scenario}"],
        ["run", "{scenario}", "--out", "{out}"],
        ["linearise", "{scenario}"],
        ["mismatch", "{scenario}"],
        ["matrix", "--aircraft", "{folder}", "--out", "{out}"],
        pytest.param(["derive", "{folder}", "--out", "{out}"], marks=needs.command("derive")),
        pytest.param(["derive", "{folder}/trainer.xml", "--out", "{out}"], marks=needs.command("derive")),
        pytest.param(["live", "{scenario}"], marks=needs.command("live")),
    ],
    ids=lambda asked: " ".join(asked[:2]),
)
def test_no_command_lets_it_act(machine, asked, monkeypatch):
    monkeypatch.chdir(machine.root)
    machine.put("trainer.xml", '<output name="{precious}" type="CSV" rate="1"/>')
    machine.put("trainer.xml", '<output name="127.0.0.1" type="SOCKET" port="{tcp}" protocol="TCP"/>')
    given = {"scenario": machine.scenario, "folder": "./trainer", "out": machine.root / "trainer" / "out"}
    said = refused(*(word.format(**given) for word in asked))
    machine.untouched()
    if "{folder}/trainer.xml" in asked:  # of a model alone a copy is made, without them
        assert said.startswith("trainer: its aerodynamics read no surface by a known name")
    else:
        assert "trainer.xml:" in said
        assert '<output name="' in said


@needs.service("compare")
def test_no_public_function_lets_it_act(machine):
    machine.put("trainer.xml", '<input port="{free}"/>')
    for call in (bf.trim, bf.fly, bf.linearise, bf.load):
        with pytest.raises(BadInput, match=r"<input port=.*> listens on a port, allowed: "):
            call(str(machine.scenario))
    machine.untouched()


def test_entities_are_not_expanded(machine):
    """Ten levels of ten: a thousand million letters."""
    levels = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 10))
    model = machine.folder / "trainer.xml"
    bomb = f'<!DOCTYPE fdm_config [<!ENTITY e0 "boom"> <!ENTITY f SYSTEM "file:///etc/passwd"> {levels}]>'
    text = model.read_text().replace("<fdm_config", f"{bomb}<fdm_config", 1)
    model.write_text(text.replace("A made-up aircraft", "&e9; &f;"))
    (line,) = refused("validate", machine.scenario).splitlines()
    assert line.endswith("<!DOCTYPE fdm_config> may define entities, allowed: XML without a DOCTYPE")


@needs.service("compare")
def test_a_link_out_of_the_aircrafts_folder_is_refused(machine):
    """Also one that stays below the scenario's own folder."""
    rudder = machine.folder / "Systems" / "rudder.xml"
    rudder.rename(machine.root / "rudder.xml")
    rudder.symlink_to(machine.root / "rudder.xml")
    assert refused("validate", machine.scenario).startswith(f"{rudder}:1: is a link out of the folder")


def test_a_namespace_hides_nothing(machine):
    """JSBSim's parser knows none: to it the element is an output whatever xmlns says."""
    machine.put("trainer.xml", '<output xmlns="urn:x" name="{precious}" type="CSV"/>')
    assert "<output xmlns=" in refused("validate", machine.scenario)
    machine.untouched()


@pytest.mark.parametrize("name", ["simulation/write-state-file", "simulation/do_linearization"])
def test_a_property_of_the_aircraft_file_writes_nothing_either(machine, name):
    """The second writes where the model's name says, which may be an absolute path."""
    file = machine.folder / "aircraft.yaml"
    file.write_text(file.read_text().replace("fcs/aileron-cmd-rad", name))
    says = "surfaces.aileron.command: makes JSBSim write a file, allowed: other properties"
    assert says in refused("validate", machine.scenario)


@pytest.mark.parametrize("name", ["c172x", "737", "ball"])
def test_what_the_jsbsim_package_has_neither_writes_nor_listens(name, tmp_path, monkeypatch):
    """Its c172x writes a file, connects twice and listens: as it is, it is refused; its copy does nothing."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput, match=r"<(output|input) "):
        bare(source_of(name))
    try:
        model = instrument(source_of(name), tmp_path / name, {})
    except BadInput:  # a ball has no aerodynamics to instrument
        return
    bare(model)
    for port in (1137, 5137, 5139):
        with socket.socket() as listening:
            assert listening.connect_ex(("127.0.0.1", port)) != 0
    assert [path.name for path in tmp_path.iterdir()] == [name]
