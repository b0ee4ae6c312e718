"""What the commands on the pages take for granted in their folder: files of pages and of the checkout."""

import re
import shutil
from pathlib import Path

import yaml

from beaver_ftc_live.challenge import folders, grading
from beaver_ftc_logs import sample_logs

from .documents import files_of_pages, python_blocks, yaml_blocks
from .installation import ROOT, Installation

BRIEF = """\
name: brief
duration_s: 4
reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.5}}]}
"""


def lay_out(line: str, folder: Path, installation: Installation, in_short: bool = False) -> None:
    """Put into the folder what the command names; in_short: a sweep of 200 flights with 60 of them."""
    for name, text in files_of_pages().items():
        if any(word in line for word in (name, f"{name.removesuffix('.py')}:")):
            (folder / name).write_text(text.replace("runs: 200\n", "runs: 60\n") if in_short else text)
            for other in files_of_pages():  # the base of a sweep, the detector of a scenario
                if other in text:
                    (folder / other).write_text(files_of_pages()[other])
    for pattern, put in _MATERIALS.items():
        if re.search(pattern, line):
            put(folder)
    if "--model wing.json" in line:
        _identified(folder, installation)
    if "navion" in line and "derive" not in line:
        _derived(folder, installation)
    if "engines-alone" in line:
        _with_engines(folder, installation)
    for name in re.findall(r"\bruns/([\w-]+)", line):
        if line.startswith(("beaver-ftc compare", "beaver-ftc check")):
            _fly(name, folder, installation, *["--certificate"] * ("check" in line))


def _fly(name: str, folder: Path, installation: Installation, *options: str) -> None:
    given = f"{name}.yaml" if (folder / f"{name}.yaml").exists() else name
    done = installation.beaver("run", given, "--no-report", *options, cwd=folder)
    assert done.returncode in (0, 1)  # 1: missed


def _shown(page: str, name: str) -> str:
    """The YAML of this name on a page."""
    return next(block for block in yaml_blocks(page) if yaml.safe_load(block).get("name") == name)


def _my_case(folder: Path) -> None:
    """The first scenario of one's own with the law changed, as the page says."""
    text = _shown("docs/tutorials/start.md", "my-case")
    assert "law: fault-tolerant-published" in text
    (folder / "my-case.yaml").write_text(text.replace("law: fault-tolerant-published", "law: nominal"))


def _shown_scenario(name: str):
    """Puts a scenario of docs/reference/scenarios.md into its file."""
    return lambda folder: (folder / f"{name}.yaml").write_text(_shown("docs/reference/scenarios.md", name))


def _my_sweep(folder: Path) -> None:
    """The sweep of docs/how-to/sweeps.md with two flights."""
    text = _shown("docs/how-to/sweeps.md", "losses-and-laws")
    assert "runs: 200\n" in text
    for name in ("my-sweep.yaml", "my.sweep.yaml"):
        (folder / name).write_text(text.replace("runs: 200\n", "runs: 2\n"))


def _my_plan(folder: Path) -> None:
    (folder / "my-plan.yaml").write_text(_shown("docs/how-to/evidence.md", "my-plan"))


def _scenarios(folder: Path) -> None:
    (folder / "scenarios").mkdir()
    for name in ("elevator-partial-loss", "aileron-bias"):
        shutil.copy(ROOT / "scenarios" / f"{name}.yaml", folder / "scenarios")


def _brief(folder: Path) -> None:
    for name in ("brief.yaml", "brief.scenario.yaml"):
        (folder / name).write_text(BRIEF)


def _mine(folder: Path) -> None:
    """The detector of plugins.md as a module of the working folder, and the scenario that names it."""
    (folder / "mine.py").write_text(python_blocks(ROOT / "docs/reference/plugins.md")[0])
    (folder / "mine.yaml").write_text(_shown("docs/reference/plugins.md", "mine"))


def _sample_logs(folder: Path) -> None:
    """The logs that the page's command before writes."""
    (folder / "my-logs").mkdir()
    for name, text in sample_logs.files().items():
        (folder / "my-logs" / name).write_text(text)


def _identified(folder: Path, installation: Installation) -> None:
    """The model that the page's command before makes."""
    given = "identify my-logs/healthy.csv --vehicle my-logs/vehicle.yaml --out wing.json"
    assert installation.beaver(*given.split(), cwd=folder).returncode == 0


def _examples(of: str):
    """Puts the files of one folder of the examples there."""
    return lambda folder: [shutil.copy(path, folder) for path in (ROOT / "examples" / of).iterdir()]


def _with_engines(folder: Path, installation: Installation) -> None:
    """The folder that the page's command before makes."""
    given = ("derive", "jsbsim:737", "--engines", "--out", "aircraft")
    assert installation.beaver(*given, cwd=folder).returncode == 0


def _derived(folder: Path, installation: Installation) -> None:
    """The folder that the page's command before makes."""
    assert installation.beaver("derive", "navion.xml", "--out", "aircraft", cwd=folder).returncode == 0


def _challenge(folder: Path) -> None:
    """The challenge that the page's first command makes, with a submission."""
    challenge = folder / "autumn"
    folders.new(challenge, 4, grading.rules())
    shutil.copy(challenge / "public" / "detector.py", challenge / "submissions" / "ada-1.py")


def _copy(relative: str):
    return lambda folder: shutil.copytree(ROOT / relative, folder / relative)


def _checker(folder: Path) -> None:
    """The checker of certificates and what stands beside it in a checkout, without the package."""
    for file in (
        Path("src/beaver_ftc_assurance/certificates/check_certificate.py"),
        Path("tools/check_certificate.py"),
    ):
        (folder / file.parent).mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, folder / file)


_MATERIALS = {
    r"challenge (submit|grade)": _challenge,
    r"^(?!.*\bnew my-case).*\bmy-case\b": _my_case,
    r"\bjammed-elevator\b": _shown_scenario("jammed-elevator"),
    r"\bwindy\b": _shown_scenario("windy"),
    r"\bmy[-.]sweep\b": _my_sweep,
    r"\bmy-plan\b": _my_plan,
    r"\bscenarios/": _scenarios,
    r"\bbrief\.yaml\b|^pytest$": _brief,
    r"\bmy-logs/": _sample_logs,
    r"\bmine[:.]": _mine,
    r"\bnavion": _examples("own-aircraft"),
    r"\bjet\.yaml\b": _examples("outer-loops"),
    r"engines-alone": _examples("engines"),
    r"(?<!\./)\baircraft/": _copy("aircraft"),
    r"\bdocs/": _copy("docs"),
    r"\btests/data\b": _copy("tests/data"),
    r"\btools/check_certificate\b": _checker,
    r"\btools\.": _copy("tools"),
    r"\bmy-(detector|cusum)\b": _copy("examples"),
}
