"""The pages that a newcomer reads first: what they show is printed, what they point to is there."""

import re
from pathlib import Path

from typer.testing import CliRunner

from beaver_ftc.cli.main import COMMANDS, app

ROOT = Path(__file__).parents[1]
README, START, QUESTIONS = (
    (ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "docs/start.md", "docs/questions.md")
)


def test_the_verdict_shown_is_the_one_printed(tmp_path):
    shown = START.split("```text")[1].split("```")[0].strip().splitlines()
    arguments = ["run", "elevator-partial-loss", "--no-report", "--out", str(tmp_path)]
    printed = CliRunner(env={"COLUMNS": "80"}).invoke(app, arguments).stdout.splitlines()
    assert [line.rstrip() for line in printed[: len(shown)]] == shown


def test_every_link_leads_somewhere():
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", README) if "://" not in link]
    assert len(links) > 10
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_every_command_is_mentioned():
    assert [name for name in COMMANDS if f"`{name}" not in QUESTIONS] == []
