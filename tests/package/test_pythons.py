"""Every Python that pyproject.toml names can install what it is for; others are told why not."""

import sys
import tomllib
from pathlib import Path

import pytest

from tests.package.building import ROOT, build
from tests.package.pythons import COMMANDS, pip_of, program_of, python, run, scripts

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
NAMED = "Programming Language :: Python :: 3."
SUPPORTED = [f"3.{c.removeprefix(NAMED)}" for c in PROJECT["classifiers"] if c.startswith(NAMED)]
WITHOUT_HARNESS = ("3.9", "3.10")
WITH_HARNESS = [version for version in SUPPORTED if version not in WITHOUT_HARNESS]
TOO_OLD = "3.8"
UNREACHABLE = ("connection broken by", "ConnectionError", "Temporary failure in name resolution")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, tmp_path_factory.mktemp("dist"))[0]


def interpreter(version: str) -> Path:
    found = python(version)
    if found is None:
        pytest.skip(f"there is no Python {version} here")
    return found


@pytest.mark.parametrize("version", WITH_HARNESS)
def test_a_clean_environment_takes_it(wheel: Path, tmp_path: Path, version: str) -> None:
    if version == f"{sys.version_info.major}.{sys.version_info.minor}":
        pytest.skip("this Python, in test_installed.py")
    constraints = ("--constraint", ROOT / "constraints.txt")
    its_python = installed(interpreter(version), tmp_path, f"{wheel}[conformance]", *constraints)
    for command in COMMANDS:
        done = run(program_of(tmp_path, command), "--help", cwd=tmp_path)
        assert done.stdout.startswith(f"usage: {command} "), done
    done = run(its_python, "-m", "splatbus_conformance", "--plain", "list", cwd=tmp_path)
    assert "FRM-3" in done.stdout, done


@pytest.mark.parametrize("version", WITHOUT_HARNESS)
def test_an_older_one_takes_the_pair_and_numpy_alone(
    wheel: Path, tmp_path: Path, version: str
) -> None:
    installed(interpreter(version), tmp_path, wheel)
    done = run(*pip_of(tmp_path), "list", "--format=freeze", cwd=tmp_path)
    names = {line.partition("==")[0] for line in done.stdout.split()}
    assert names == {"numpy", "splatbus-protocol"}
    done = run(program_of(tmp_path, "splatbus-client"), "snapshot", "it.png", cwd=tmp_path)
    assert "pip install 'splatbus-protocol[client]'" in done.stderr
    done = run(program_of(tmp_path, "splatbus-conformance"), cwd=tmp_path)
    assert done.stderr.startswith(f"Python 3.11 or newer is needed, and this is {version}.")
    assert done.stderr.count("\n") == 1
    judged = (
        ("client", "view", "FRM-3,POS-4,IMG-12"),
        ("server", "--quiet --size 64x48", "FRM-3,REQ-7,IMG-5"),
    )
    for side, words, select in judged:
        launch = f'"{program_of(tmp_path, f"splatbus-{side}")}" {words}'
        judging = ("-m", "splatbus_conformance", "--plain", side, "--launch", launch)
        done = run(sys.executable, *judging, "--select", select, cwd=tmp_path)
        assert done.returncode == 0, done.stdout


def test_a_harness_without_its_extra_says_which(wheel: Path, tmp_path: Path) -> None:
    its_python = installed(Path(sys.executable), tmp_path, wheel)
    done = run(its_python, "-m", "splatbus_conformance", cwd=tmp_path)
    assert done.returncode != 0
    assert "pip install 'splatbus-protocol[conformance]'" in done.stderr
    assert done.stderr.count("\n") == 1


def installed(base: Path, folder: Path, *wanted: str | Path) -> Path:
    """The Python of a new environment of `base` that has what is wanted."""
    run(base, "-m", "venv", "--without-pip", folder, cwd=folder)
    pip = pip_of(folder)
    options = ("--retries=1", "--no-compile", "--disable-pip-version-check")
    done = run(*pip, "install", *options, *wanted, cwd=folder)
    if any(sign in done.stderr for sign in UNREACHABLE):
        pytest.skip("no package registry can be reached")
    assert done.returncode == 0, done.stderr
    done = run(*pip, "check", cwd=folder)
    assert done.returncode == 0, done.stdout
    return scripts(folder) / "python"


def test_pip_refuses_an_older_one_and_says_why(wheel: Path, tmp_path: Path) -> None:
    options = ("install", "--no-deps", "--no-index", "--target", tmp_path / "target", wheel)
    done = run(interpreter(TOO_OLD), "-m", "pip", *options, cwd=tmp_path)
    assert done.returncode != 0
    assert f"requires a different Python: {TOO_OLD}." in done.stderr
    assert "not in '>=3.9'" in done.stderr
    assert not (tmp_path / "target").exists()


@pytest.mark.parametrize("version", [TOO_OLD, *WITHOUT_HARNESS])
@pytest.mark.parametrize(
    ("module", "folder"), [("splatbus_conformance", "conformance"), ("tests", ".")]
)
def test_an_older_one_that_runs_the_checkout_is_told_why_not(
    version: str, module: str, folder: str
) -> None:
    python_ = interpreter(version)
    done = run(python_, "-m", module, cwd=ROOT, PYTHONPATH=folder, PYTHONDONTWRITEBYTECODE="1")
    assert done.returncode != 0
    assert f"Python 3.11 or newer is needed, and this is {version}." in done.stderr
    assert done.stderr.count("\n") == 1
