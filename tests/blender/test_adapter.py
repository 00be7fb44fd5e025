"""Cameras and empties of Blender steer the harness, which judges what comes of them."""

import shlex
from pathlib import Path

import pytest

from tests.blender.running import PROGRAMS, environment, python
from tests.conformance.harness import run

WHOLE_SECONDS = 600
"""For a verdict on all; it takes 45 where little else runs."""


@pytest.mark.timeout(2 * WHOLE_SECONDS)
@pytest.mark.parametrize("seed", ["0", "1"])
def test_it_conforms(seed: str, tmp_path: Path) -> None:
    ours = environment(tmp_path)
    given = [f"{name}={ours[name]}" for name in ("PYTHONPATH", "BLENDER_USER_RESOURCES")]
    command = shlex.join(["env", *given, python(), str(PROGRAMS / "adapter.py")])
    words = ("client", "--adapter", command, "--shrink", "0", "--seed", seed)
    status, told = run(*words, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert "\nconforming at L2: " in told
