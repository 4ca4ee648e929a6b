"""The house stands: layout, imports, lint, types; the README's commands are those CI runs."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOP_LEVEL = {
    "pyproject.toml", "planner", "hand_models", "estimator", "sim_sensor", "tests", "scripts",
    "README.md", "LICENSE",
}  # fmt: skip


def run(*command):
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def tracked():
    """What git tracks; in a checkout without git, what lies there but for what tests leave."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode == 0:
        return listed.stdout.split()
    made = ("__pycache__", ".egg-info", "build", "out")
    paths = (p.relative_to(ROOT) for p in ROOT.rglob("*") if p.is_file())
    return [
        str(p)
        for p in paths
        if not any(part.endswith(made) or part.startswith(".") for part in p.parts)
    ]


def test_top_level_is_the_one_the_user_fixed():
    names = {Path(name).parts[0] for name in tracked()}
    assert {name for name in names if not name.startswith(".")} == TOP_LEVEL


def test_imports_go_one_way():
    """Contracts in pyproject.toml: two storeys on two cellars, neighbours are strangers."""
    script = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


def test_estimator_imports_without_pinocchio_or_casadi():
    script = (
        "import sys; sys.modules.update(dict.fromkeys(('pinocchio', 'casadi', 'coal', 'meshcat')));"
        "import estimator, pkgutil, importlib;"
        "[importlib.import_module(m.name) for m in pkgutil.iter_modules("
        "estimator.__path__, 'estimator.')]"
    )
    subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=True)


def test_ruff_finds_nothing():
    run("ruff", "check", ".")


def test_code_is_formatted():
    run("ruff", "format", "--check", ".")


def test_types_are_strict():
    run("mypy")


def test_ci_runs_exactly_the_readmes_test_command():
    readme = (ROOT / "README.md").read_text()
    commands = re.findall(r"^python3 -m venv .*$", readme, flags=re.MULTILINE)
    assert len(commands) == 2
    assert commands[1] in (ROOT / ".ci" / "run").read_text().splitlines()


def test_every_dependency_is_pinned_in_the_tested_set():
    text = (ROOT / "pyproject.toml").read_text()
    named = re.findall(r'^\s+"([a-zA-Z][\w-]*)>=', text, flags=re.MULTILINE)
    pinned = {
        line.split("==")[0].lower().replace("_", "-")
        for line in (ROOT / ".ci" / "constraints.txt").read_text().split()
    }
    assert len(named) >= 14
    assert {name.lower() for name in named} <= pinned


@pytest.mark.parametrize("suffix", ["*.py", "*.toml", "*.md"])
def test_no_file_names_a_machine(suffix):
    paths = [p for p in map(Path, tracked()) if p.match(suffix) and p.name != "test_house.py"]
    assert paths
    for path in paths:
        found = re.findall(r"(?<![\w.])/(?:work|root|tmp)/", (ROOT / path).read_text())
        assert not found, f"{path}: {found}"
