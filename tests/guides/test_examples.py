"""What the guides show in Python works: the whole client, the tests by vectors, the adapters."""

import ast
import json
import os
import socket
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.conformance.harness import run
from tests.guides.desk import EXAMPLE, GUIDES
from tests.guides.pages import ROOT, Block, blocks

WRITING = [it for it in blocks(GUIDES / "write-a-client.md") if it.language == "python"]
BLENDER = [it for it in blocks(GUIDES / "test-a-blender-client.md") if it.language == "python"]
VIEWER_FOR_BLENDER = """\
import splatbus_client
from splatbus_wire.conventions import ENGINES
from splatbus_wire.poses import Pose

def begin():
    global session
    session = splatbus_client.connect()

def end():
    session.close()

def send_camera(position, rotation):
    pose = Pose(tuple(position), tuple(rotation))
    session.send_camera(ENGINES[ROW].to_wire(pose))
"""


@pytest.fixture
def beside_the_example(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the blocks expect: the folder of the project, and the example within reach."""
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))
    monkeypatch.delitem(sys.modules, "minimal_client", raising=False)


def test_the_example_needs_the_standard_library_alone() -> None:
    tree = ast.parse(EXAMPLE.read_text("utf-8"))
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        for name in (
            [each.name for each in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert imported
    assert imported <= sys.stdlib_module_names


@pytest.mark.usefixtures("beside_the_example")
@pytest.mark.parametrize("block", WRITING, ids=str)
def test_a_step_holds_for_the_example(block: Block) -> None:
    exec(compile(block.text, str(block), "exec"), {})


@pytest.mark.usefixtures("beside_the_example")
@pytest.mark.parametrize(
    ("number", "name", "instead"),
    [
        (0, "MAX_PAYLOAD", 2_000_000),
        (1, "finite", float),
        (2, "row_begins", lambda ring, plane, slot, height, pitch, row: row * pitch),
    ],
)
def test_a_step_finds_a_mistake(
    number: int, name: str, instead: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    import minimal_client

    monkeypatch.setattr(minimal_client, name, instead)
    with pytest.raises(AssertionError):
        exec(compile(WRITING[number].text, "step", "exec"), {})


def test_the_loop_for_blender_goes_round(monkeypatch: pytest.MonkeyPatch) -> None:
    """It drives what it is given, for as long as that runs."""

    class Client:
        rounds = 0

        @property
        def running(self) -> bool:
            return self.rounds < 3

        def update(self) -> None:
            self.rounds += 1

    client, module = Client(), ModuleType("my_client")
    module.start = lambda: client  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "my_client", module)
    exec(compile(BLENDER[0].text, "blender", "exec"), {})
    assert client.rounds == 3


@pytest.mark.parametrize(
    ("row", "status"), [("blender_camera", 0), ("blender_object", 1)], ids=["right", "wrong"]
)
def test_the_adapter_for_blender_shows_whether_a_camera_is_right(
    row: str, status: int, tmp_path: Path
) -> None:
    """The adapter of the guide, in a process that stands for Blender, by way of engine_adapter."""
    (tmp_path / "my_client.py").write_text(VIEWER_FOR_BLENDER.replace("ROW", repr(row)), "utf-8")
    (tmp_path / "my_adapter.py").write_text(BLENDER[1].text, "utf-8")
    command = (
        f'"{sys.executable}" "{GUIDES / "engine_adapter.py"}" "{sys.executable}" my_adapter.py'
    )
    options = ("--select", "CNV-6", "--profile", "brief", "--shrink", "0")
    found, output = run("client", "--adapter", command, *options, cwd=tmp_path)
    assert found == status, output
    assert "CNV-6" in output
    assert "not conforming" in output if status else "conforming at L2" in output


def test_a_long_answer_of_the_adapter_for_blender_comes_whole(tmp_path: Path) -> None:
    """In each Python that Blender brings: before 3.13 a text file over a socket keeps its end."""
    (tmp_path / "my_client.py").write_text(
        "def begin(): pass\ndef end(): pass\n"
        "def send_camera(position, rotation): return {'text': 'x' * 100_000}\n",
        "utf-8",
    )
    (tmp_path / "my_adapter.py").write_text(BLENDER[1].text, "utf-8")
    with socket.create_server(("127.0.0.1", 0)) as listener:
        engine = subprocess.Popen(
            [sys.executable, "my_adapter.py"],
            cwd=tmp_path,
            env={**os.environ, "SPLATBUS_ADAPTER_PORT": str(listener.getsockname()[1])},
        )
        harness = listener.accept()[0]
    harness.settimeout(20)
    with engine, harness, harness.makefile("rw", encoding="utf-8") as lines:
        assert json.loads(lines.readline())["adapter"] == "1"
        for number, name in enumerate(("send_camera", "stop"), 1):
            pose = {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]} if number == 1 else {}
            print(json.dumps({"id": number, "command": name, **pose}), file=lines, flush=True)
            answer = json.loads(lines.readline())
            assert answer["id"] == number
            assert len(answer.get("text", "")) == (100_000 if number == 1 else 0)
    assert engine.returncode == 0


TABLE = (ROOT / "spec" / "1.0" / "07-conventions.md").read_text("utf-8")
ROWS = [
    ("test-a-unity-client.md", "Unity, camera and object"),
    ("test-an-unreal-client.md", "Unreal, camera and object"),
    ("test-a-blender-client.md", "Blender, object"),
    ("test-a-blender-client.md", "Blender, camera"),
]


@pytest.mark.parametrize(("page", "row"), ROWS)
def test_both_directions_of_axes_stand_in_the_guide_as_in_the_specification(
    page: str, row: str
) -> None:
    """Whoever converts a pose has to know which way."""
    found = next(line for line in TABLE.splitlines() if line.startswith(f"| {row} | "))
    text = (GUIDES / page).read_text("utf-8")
    for cell in found.strip("| ").split(" | ")[2:]:
        assert cell.strip() in text, f"{page} lacks {cell}"


def test_an_engine_that_crashes_is_said_to_have_crashed(tmp_path: Path) -> None:
    """The status of the adapter tells it."""
    (tmp_path / "engine.py").write_text(
        "import os, socket, json\n"
        "port = int(os.environ['SPLATBUS_ADAPTER_PORT'])\n"
        "lines = socket.create_connection(('127.0.0.1', port)).makefile('rw', buffering=1)\n"
        "print(json.dumps({'adapter': '1', 'client': {'name': 'x', 'version': '1'}, 'axes':\n"
        "    'unity', 'unitsPerMetre': 1, 'precision': 'single', 'can': ['start']}), file=lines)\n"
        "lines.readline()\n"
        "os.abort()\n",
        "utf-8",
    )
    command = f'"{sys.executable}" "{GUIDES / "engine_adapter.py"}" "{sys.executable}" engine.py'
    found, output = run("client", "--adapter", command, "--select", "FRM-1", cwd=tmp_path)
    assert found != 0
    assert "134" in output or "SIGABRT" in output, output
