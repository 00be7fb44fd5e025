"""The C# of the guide for Unity compiles as it is pasted, a file each, and its adapter answers.

Mono's compiler and an engine of our own (`unity_engine.cs`) stand for Unity.
"""

import json
import os
import shutil
import socket
import subprocess
from pathlib import Path

import pytest

from tests.guides.desk import GUIDES
from tests.guides.pages import blocks

CSHARP = [it for it in blocks(GUIDES / "test-a-unity-client.md") if it.language == "csharp"]
ENGINE = Path(__file__).with_name("unity_engine.cs")
SECONDS = 60
pytestmark = pytest.mark.skipif(
    not (shutil.which("mcs") and shutil.which("mono")), reason="it takes Mono: mono-mcs, mono"
)


@pytest.fixture(scope="module")
def player(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The guide's scripts, compiled as Unity compiles a project's: each a file."""
    folder = tmp_path_factory.mktemp("unity")
    for block in CSHARP:
        name = block.text.split("class ")[1].split()[0]
        (folder / f"{name}.cs").write_text(block.text, "utf-8")
    program = folder / "player.exe"
    found = subprocess.run(
        ["mcs", "-warnaserror", "-nowarn:649", f"-out:{program}", str(ENGINE)]
        + [str(path) for path in folder.glob("*.cs")],
        capture_output=True,
        text=True,
        timeout=SECONDS,
    )
    assert found.returncode == 0, found.stdout + found.stderr
    return program


def test_every_script_of_the_guide_is_compiled(player: Path) -> None:
    assert sorted(path.stem for path in player.parent.glob("*.cs")) == [
        "SplatBusAdapter",
        "SplatBusPorts",
        "SplatBusTests",
    ]


def test_the_adapter_sets_the_camera_and_answers_each_command(player: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(SECONDS)
        engine = subprocess.Popen(
            ["mono", str(player)],
            env={**os.environ, "SPLATBUS_ADAPTER_PORT": str(listener.getsockname()[1])},
            stdout=subprocess.PIPE,
            text=True,
        )
        harness = listener.accept()[0]
    harness.settimeout(SECONDS)
    with harness, harness.makefile("rw", encoding="utf-8") as lines:
        greeting = json.loads(lines.readline())
        assert (greeting["adapter"], greeting["axes"]) == ("1", "unity")
        answers = []
        for number, command in enumerate(
            (
                {"command": "start"},
                {"command": "send_camera", "position": [1, 2.5, -3], "rotation": [0, 0.6, 0, 0.8]},
                {"command": "fly"},
                {"command": "stop"},
            ),
            1,
        ):
            print(json.dumps({"id": number, **command}), file=lines, flush=True)
            answers.append(json.loads(lines.readline()))
    assert answers == [{"id": 1}, {"id": 2}, {"id": 3, "error": "no such command"}, {"id": 4}]
    output, _ = engine.communicate(timeout=SECONDS)
    assert engine.returncode == 0, "it has to run in the background"
    assert output.split() == ["1", "2.5", "-3", "0", "0.6", "0", "0.8"]
