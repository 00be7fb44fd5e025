"""Cameras and empties of Blender steer the harness, which judges what comes of them."""

import shlex
import subprocess
from pathlib import Path

import pytest

from tests.blender.running import ROOT, adapter, python
from tests.conformance.harness import run
from tests.guides.pages import blocks

WHOLE_SECONDS = 900
"""For a verdict on all; it takes 60 where little else runs."""


@pytest.mark.timeout(2 * WHOLE_SECONDS)
@pytest.mark.parametrize("seed", ["0", "1"])
def test_it_conforms(seed: str, tmp_path: Path) -> None:
    words = ("client", *adapter(python(), tmp_path), "--shrink", "0", "--seed", seed)
    status, told = run(*words, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert "\nconforming at L2: " in told


@pytest.mark.timeout(2 * WHOLE_SECONDS)
def test_the_commands_of_the_page_judge_it_as_it_is_installed(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BLENDER_USER_RESOURCES", str(tmp_path))
    page = blocks(ROOT / "reference_client" / "blender" / "README.md")
    (script,) = (it.text for it in page if it.language == "python")
    (drive := tmp_path / "drive.py").write_text(script)
    lines = "".join(it.text for it in page if it.language == "sh")
    ours = {"blender-env/bin/python": python(), drive.name: str(drive), archive.name: str(archive)}
    for theirs, here in ours.items():
        lines = lines.replace(theirs, here)
    *_, install, launch, steer, _ = map(shlex.split, lines.splitlines())
    subprocess.run(install, check=True)
    for (_, *line), level in ((launch, "L1"), (steer, "L2")):
        status, told = run(*line, limit=WHOLE_SECONDS)
        assert status == 0, told
        assert f"\nconforming at {level}: " in told
