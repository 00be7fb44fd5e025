"""A launched testee: what it finds in its environment, and how it is ended."""

import os
import sys
from pathlib import Path

import pytest
from splatbus_conformance.trials.testee.process import Launched

from tests.waiting import eventually

SAYS = """
import os, pathlib, sys, time
said = f"{os.environ['USUAL']} {os.environ.get('ADDED')}"
pathlib.Path(sys.argv[1]).write_text(said)
time.sleep(60)
"""


def test_variables_stand_before_the_usual_ones_and_can_be_taken_back(tmp_path: Path) -> None:
    """It is ended before it is started otherwise."""
    script, file = tmp_path / "says.py", tmp_path / "said"
    script.write_text(SAYS)
    file.touch()
    launched = Launched(f'"{sys.executable}" "{script}" "{file}"', {"USUAL": "usual"})
    try:
        for added, said in (
            ({}, "usual None"),
            ({"ADDED": "more"}, "usual more"),
            ({"USUAL": "other"}, "other None"),
            ({}, "usual None"),
        ):
            launched.add_to_environment(added)
            assert launched.ended() is None
            assert launched.ensure_running()
            assert not launched.ensure_running()
            assert eventually(lambda said=said: file.read_text() == said)
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
        assert eventually(file.exists)
        launched.stop()
        assert not file.exists()
    finally:
        launched.close()
