"""Cameras and empties of Blender steer the harness, which judges what comes of them."""

from pathlib import Path

import pytest

from tests.blender.running import adapter, python
from tests.conformance.harness import run

WHOLE_SECONDS = 900
"""For a verdict on all; it takes 60 where little else runs."""


@pytest.mark.timeout(2 * WHOLE_SECONDS)
@pytest.mark.parametrize("seed", ["0", "1"])
def test_it_conforms(seed: str, tmp_path: Path) -> None:
    words = ("client", *adapter(python(), tmp_path), "--shrink", "0", "--seed", seed)
    status, told = run(*words, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert "\nconforming at L2: " in told
