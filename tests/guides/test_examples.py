"""What the guides show in Python works: the whole client, the tests by vectors, the adapters."""

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.conformance.harness import run
from tests.guides.desk import EXAMPLE, GUIDES, answers_of
from tests.guides.pages import ROOT, blocks

WRITING, BLENDER = (
    [it.text for it in blocks(GUIDES / f"{name}.md") if it.language == "python"]
    for name in ("write-a-client", "test-a-blender-client")
)
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
ENGINE = f'"{sys.executable}" "{GUIDES / "engine_adapter.py"}" "{sys.executable}"'


def test_the_example_needs_the_standard_library_alone() -> None:
    imports = r"^\s*(?:from|import) (\w+)"
    imported = re.findall(imports, EXAMPLE.read_text("utf-8"), re.MULTILINE)
    assert imported
    assert set(imported) <= sys.stdlib_module_names


@pytest.mark.parametrize(
    ("number", "name", "wrong"),
    [
        (0, "MAX_PAYLOAD", 2_000_000),
        (1, "finite", float),
        (2, "row_begins", lambda ring, plane, slot, height, pitch, row: row * pitch),
    ],
)
def test_a_step_holds_for_the_example_and_finds_a_mistake(
    number: int, name: str, wrong: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(WRITING) == 3
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))
    monkeypatch.delitem(sys.modules, "minimal_client", raising=False)
    exec(compile(WRITING[number], "step", "exec"), {})
    monkeypatch.setattr(sys.modules["minimal_client"], name, wrong)
    with pytest.raises(AssertionError):
        exec(compile(WRITING[number], "step", "exec"), {})


def test_the_loop_for_blender_goes_round(monkeypatch: pytest.MonkeyPatch) -> None:
    """It drives what it is given, for as long as that runs."""

    class Client(ModuleType):
        rounds = 0
        running = property(lambda it: it.rounds < 3)

        def start(self) -> "Client":
            return self

        def update(self) -> None:
            self.rounds += 1

    client = Client("my_client")
    monkeypatch.setitem(sys.modules, "my_client", client)
    exec(compile(BLENDER[0], "blender", "exec"), {})
    assert client.rounds == 3


@pytest.mark.parametrize(("row", "status"), [("blender_camera", 0), ("blender_object", 1)])
def test_the_adapter_for_blender_shows_whether_a_camera_is_right(
    row: str, status: int, tmp_path: Path
) -> None:
    """The adapter of the guide, in a process that stands for Blender, by way of engine_adapter."""
    (tmp_path / "my_client.py").write_text(VIEWER_FOR_BLENDER.replace("ROW", repr(row)), "utf-8")
    (tmp_path / "my_adapter.py").write_text(BLENDER[1], "utf-8")
    options = ("--select", "CNV-6", "--profile", "brief", "--shrink", "0")
    found, output = run("client", "--adapter", f"{ENGINE} my_adapter.py", *options, cwd=tmp_path)
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
    (tmp_path / "my_adapter.py").write_text(BLENDER[1], "utf-8")
    pose = {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]}
    greeting, answers, _ = answers_of(
        [sys.executable, "my_adapter.py"],
        tmp_path,
        {"command": "send_camera", **pose},
        {"command": "stop"},
    )
    assert greeting["adapter"] == "1"
    assert [(it["id"], len(it.get("text", ""))) for it in answers] == [(1, 100_000), (2, 0)]


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
    command = ("client", "--adapter", f"{ENGINE} engine.py", "--select", "FRM-1")
    found, output = run(*command, cwd=tmp_path)
    assert found != 0
    assert "134" in output or "SIGABRT" in output, output


@pytest.mark.parametrize(
    ("page", "row"),
    [
        ("test-a-unity-client.md", "Unity, camera and object"),
        ("test-an-unreal-client.md", "Unreal, camera and object"),
        ("test-a-blender-client.md", "Blender, object"),
        ("test-a-blender-client.md", "Blender, camera"),
    ],
)
def test_both_directions_of_axes_stand_in_the_guide_as_in_the_specification(
    page: str, row: str
) -> None:
    """Whoever converts a pose has to know which way."""
    table = (ROOT / "spec" / "1.0" / "07-conventions.md").read_text("utf-8").splitlines()
    found = next(line for line in table if line.startswith(f"| {row} | "))
    text = (GUIDES / page).read_text("utf-8")
    for cell in found.strip("| ").split(" | ")[2:]:
        assert cell.strip() in text, f"{page} lacks {cell}"
