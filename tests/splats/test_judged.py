"""The command is judged by the harness as a stranger is."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from splatbus_splats.files import ply

from tests.conformance.harness import run
from tests.splats.served import COMMAND
from tests.splats.shots import cloud

pytestmark = [pytest.mark.apart, pytest.mark.usefixtures("loops")]


def test_it_conforms(tmp_path: Path) -> None:
    """In what a renderer can do wrong: axes, objects, the scene that it tells, its time."""
    (tmp_path / "walk").mkdir()
    for i in range(3):
        ply.write(tmp_path / "walk" / f"{i}.ply", cloud(400, seed=i))
    ply.write(tmp_path / "statue.ply", cloud(700))
    files = [str(tmp_path / "statue.ply"), str(tmp_path / "walk")]
    launch = shlex.join([*COMMAND, *files, "--size", "64x48", "--quiet"])
    words = ("--profile", "brief", "--select", "CNV,OBJ,SCN,TIM", "--parallel", "1")
    code, output = run("server", "--launch", launch, *words, limit=240)
    assert code == 0, output
