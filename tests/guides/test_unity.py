"""The C# of the guide for Unity compiles as it is pasted, a file each, and its adapter answers.

Mono's compiler and an engine of our own (`unity_engine.cs`) stand for Unity.
"""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.guides.desk import GUIDES, answers_of
from tests.guides.pages import blocks

CSHARP = [it for it in blocks(GUIDES / "test-a-unity-client.md") if it.language == "csharp"]
ENGINE = Path(__file__).with_name("unity_engine.cs")
pytestmark = pytest.mark.skipif(
    not (shutil.which("mcs") and shutil.which("mono")), reason="it takes Mono: mono-mcs, mono"
)


def test_each_script_compiles_and_the_adapter_sets_the_camera_and_answers(tmp_path: Path) -> None:
    for block in CSHARP:
        name = block.text.split("class ")[1].split()[0]
        (tmp_path / f"{name}.cs").write_text(block.text, "utf-8")
    scripts = sorted(tmp_path.glob("*.cs"))
    assert [it.stem for it in scripts] == ["SplatBusAdapter", "SplatBusPorts", "SplatBusTests"]
    program = tmp_path / "player.exe"
    found = subprocess.run(
        ["mcs", "-warnaserror", "-nowarn:649", f"-out:{program}", str(ENGINE), *map(str, scripts)],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert found.returncode == 0, found.stdout + found.stderr
    greeting, answers, output = answers_of(
        ["mono", str(program)],
        tmp_path,
        {"command": "start"},
        {"command": "send_camera", "position": [1, 2.5, -3], "rotation": [0, 0.6, 0, 0.8]},
        {"command": "fly"},
        {"command": "stop"},
    )
    assert (greeting["adapter"], greeting["axes"]) == ("1", "unity")
    assert answers == [{"id": 1}, {"id": 2}, {"id": 3, "error": "no such command"}, {"id": 4}]
    assert output.split() == ["1", "2.5", "-3", "0", "0.6", "0", "0.8"]
