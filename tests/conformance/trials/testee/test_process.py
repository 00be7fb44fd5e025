"""A launched testee: what it finds in its environment, and how it is ended."""

import os
import sys
import time
from pathlib import Path

import pytest
from splatbus_conformance.trials.testee.process import Launched

SAYS = """
import os, pathlib, sys
said = f"{os.environ['USUAL']} {os.environ.get('ADDED')}"
pathlib.Path(sys.argv[1]).write_text(said)
"""


@pytest.fixture
def said(tmp_path: Path):
    """What the testee says when it is started, with these variables added if any are given."""
    script, file = tmp_path / "says.py", tmp_path / "said"
    script.write_text(SAYS)
    launched = Launched(f'"{sys.executable}" "{script}" "{file}"', {"USUAL": "usual"})

    def start(added=None) -> str:
        if added is not None:
            launched.add_to_environment(added)
        assert launched.ensure_running()
        launched._process.wait(10)
        return file.read_text().strip()

    yield start
    launched.close()


def test_it_finds_the_usual_variables(said):
    assert said() == "usual None"


def test_variables_can_be_added_and_taken_back(said):
    assert said({"ADDED": "more"}) == "usual more"
    assert said({}) == "usual None"


def test_a_variable_that_is_added_stands_before_a_usual_one(said):
    assert said({"USUAL": "other"}) == "other None"


def test_it_is_ended_before_it_is_started_otherwise(tmp_path):
    launched = Launched(f'"{sys.executable}" -c "import time; time.sleep(60)"', {})
    try:
        launched.ensure_running()
        launched.add_to_environment({"ADDED": "more"})
        assert launched.ended() is None
        assert launched.ensure_running(), "it still ran"
    finally:
        launched.close()


CLEARS_UP = """
import pathlib, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print(flush=True)
sys.stdin.read()
time.sleep(0.1)
pathlib.Path(sys.argv[1]).unlink()
"""
HAS_HELP = """
import pathlib, subprocess, sys, time
pipe = subprocess.PIPE
helper = subprocess.Popen([sys.executable, *sys.argv[1:]], stdin=pipe, stdout=pipe)
helper.stdout.readline()
pathlib.Path(sys.argv[2]).touch()
time.sleep(60)
"""


@pytest.mark.skipif(os.name != "posix", reason="groups of processes")
def test_what_it_started_may_clear_up_behind_it(tmp_path):
    """As Python does: a process of its own removes memory that was left."""
    helper, program, file = (tmp_path / name for name in ("helper.py", "program.py", "left"))
    helper.write_text(CLEARS_UP)
    program.write_text(HAS_HELP)
    launched = Launched(f'"{sys.executable}" "{program}" "{helper}" "{file}"', {})
    try:
        launched.ensure_running()
        deadline = time.monotonic() + 10
        while not file.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        assert file.exists()
        launched.stop()
        assert not file.exists()
    finally:
        launched.close()
