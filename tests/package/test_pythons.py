"""Every Python that pyproject.toml names can install the wheel; older ones are told why not."""

import shutil
import sys
import tomllib
from pathlib import Path

import pytest

from tests.package.building import ROOT, build
from tests.package.pythons import COMMANDS, python, run, scripts

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
NAMED = "Programming Language :: Python :: 3."
SUPPORTED = [f"3.{c.removeprefix(NAMED)}" for c in PROJECT["classifiers"] if c.startswith(NAMED)]
TOO_OLD = ("3.9", "3.10")
UNREACHABLE = ("connection broken by", "ConnectionError", "Temporary failure in name resolution")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, tmp_path_factory.mktemp("dist"))[0]


def interpreter(version: str) -> Path:
    found = python(version)
    if found is None:
        pytest.skip(f"there is no Python {version} here")
    return found


@pytest.mark.parametrize("version", SUPPORTED)
def test_a_clean_environment_takes_it(wheel: Path, tmp_path: Path, version: str) -> None:
    if version == f"{sys.version_info.major}.{sys.version_info.minor}":
        pytest.skip("this Python, in test_installed.py")
    run(interpreter(version), "-m", "venv", "--without-pip", tmp_path, cwd=tmp_path)
    its_python = scripts(tmp_path) / "python"
    pip = (sys.executable, "-m", "pip", "--python", its_python)
    options = ("--retries=1", "--no-compile", "--constraint", ROOT / "constraints.txt")
    done = run(*pip, "install", *options, wheel, cwd=tmp_path)
    if any(sign in done.stderr for sign in UNREACHABLE):
        pytest.skip("no package registry can be reached")
    assert done.returncode == 0, done.stderr
    done = run(*pip, "check", cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    for command in COMMANDS:
        program = shutil.which(command, path=str(scripts(tmp_path)))
        assert program is not None
        done = run(program, "--help", cwd=tmp_path)
        assert done.stdout.startswith(f"usage: {command} "), done
    done = run(its_python, "-m", "splatbus_conformance", "--plain", "list", cwd=tmp_path)
    assert "FRM-3" in done.stdout, done


@pytest.mark.parametrize("version", TOO_OLD)
def test_pip_refuses_an_older_one_and_says_why(wheel: Path, tmp_path: Path, version: str) -> None:
    options = ("install", "--no-deps", "--no-index", "--target", tmp_path / "target", wheel)
    done = run(interpreter(version), "-m", "pip", *options, cwd=tmp_path)
    assert done.returncode != 0
    assert f"requires a different Python: {version}." in done.stderr
    assert "not in '>=3.11'" in done.stderr
    assert not (tmp_path / "target").exists()


@pytest.mark.parametrize("version", TOO_OLD)
@pytest.mark.parametrize(
    ("module", "folder"), [("splatbus_conformance", "conformance"), ("tests", ".")]
)
def test_an_older_one_that_runs_the_checkout_is_told_why_not(
    version: str, module: str, folder: str
) -> None:
    python_ = interpreter(version)
    done = run(python_, "-m", module, cwd=ROOT, PYTHONPATH=folder, PYTHONDONTWRITEBYTECODE="1")
    assert done.returncode != 0
    assert done.stderr.startswith(f"Python 3.11 or newer is needed, and this is {version}.")
    assert done.stderr.count("\n") == 1
