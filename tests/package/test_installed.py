"""The wheel in an environment where it finds its dependencies, and nothing else of the project."""

import shutil
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from tests.package.building import ROOT, build
from tests.package.pythons import COMMANDS, pip_of, program_of, run, scripts

MYPY_INI = """\
[mypy]
strict = true

[mypy-numpy.*] # half a minute to read, and nothing is asked of it
follow_imports = skip
follow_imports_for_stubs = true
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel beside the packages that this process has, so that nothing is downloaded."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder)
    (site_packages,) = folder.glob("[Ll]ib/**/site-packages")
    (site_packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    wheel, _ = build(ROOT, tmp_path_factory.mktemp("dist"))
    done = run(*pip_of(folder), "install", "--no-deps", "--no-index", wheel, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_it_and_its_dependencies_agree(environment: Path) -> None:
    done = run(*pip_of(environment), "check", cwd=environment)
    assert done.returncode == 0, done.stdout


def test_it_is_the_wheel_that_runs_and_every_command_says_what_it_does(environment: Path) -> None:
    program = "import splatbus_conformance; print(splatbus_conformance.__file__)"
    done = run(scripts(environment) / "python", "-c", program, cwd=environment)
    assert Path(done.stdout.strip()).is_relative_to(environment), done
    for command in COMMANDS:
        done = run(program_of(environment, command), "--help", cwd=environment)
        assert done.stdout.startswith(f"usage: {command} "), done


def test_it_judges_from_end_to_end(environment: Path) -> None:
    python = scripts(environment) / "python"
    client = f'"{python.as_posix()}" -m splatbus_viewer view'
    options = ("--select", "FRM", "--profile", "brief", "--patience", "60")
    harness = (python, "-m", "splatbus_conformance", "--plain", "client")
    done = run(*harness, "--launch", client, *options, cwd=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "conforming at L1" in done.stdout


def test_a_type_checker_sees_its_types(environment: Path, tmp_path: Path) -> None:
    shutil.copy(ROOT / "tests" / "package" / "consumer.py", tmp_path)
    (tmp_path / "mypy.ini").write_text(MYPY_INI)
    checker = (sys.executable, "-m", "mypy", "--python-executable", scripts(environment) / "python")
    done = run(*checker, "consumer.py", cwd=tmp_path)
    assert done.stdout == "Success: no issues found in 1 source file\n", done.stdout + done.stderr
