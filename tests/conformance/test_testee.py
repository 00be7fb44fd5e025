"""A launched testee: what it finds in its environment."""

import sys
from pathlib import Path

import pytest
from splatbus_conformance.testee import Launched

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
