"""The extension as it is built, and as Blender installs it."""

import re
import subprocess
import tomllib
import venv
import zipfile
from pathlib import Path
from typing import Any

import pytest
from splatbus_server import View

from tests.blender.blenders import BLENDERS, main
from tests.blender.running import ROOT, ran
from tests.engines.stage import planes, serving

BLENDER = ROOT / "reference_client" / "blender"
EXTENSION = BLENDER / "splatbus_blender"


def test_who_cannot_build_it_is_told_what_to_install(tmp_path: Path) -> None:
    venv.create(tmp_path)
    line = [str(tmp_path / "bin" / "python"), str(BLENDER / "build.py"), str(tmp_path)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=240)
    assert done.returncode == 1
    assert done.stderr.endswith(f"{line[0]} -m pip install build hatchling\n")
    assert done.stderr.count("\n") == 1


def test_which_blenders_there_are_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    for word in ("--help", "9.9"):
        with pytest.raises(SystemExit):
            main([word])
        told = "".join(capsys.readouterr())
        assert all(each in told for each in BLENDERS)


def test_the_manifest_says_what_blender_needs() -> None:
    said = tomllib.loads((EXTENSION / "blender_manifest.toml").read_text("utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert (said["schema_version"], said["type"]) == ("1.0.0", "add-on")
    assert re.fullmatch(r"\d+\.\d+\.\d+", said["version"])
    assert said["version"] == project["version"]
    assert said["license"] == [f"SPDX:{project['license']}"]
    assert said["blender_version_min"] == "4.2.0"
    for each in (said["tagline"], *said["permissions"].values()):
        assert len(each) <= 64
        assert not each.endswith(".")


def test_the_archive_has_the_client_and_nothing_of_blender(archive: Path) -> None:
    with zipfile.ZipFile(archive) as held:
        names = held.namelist()
        (wheel,) = (each for each in names if each.endswith(".whl"))
        said = tomllib.loads(held.read("blender_manifest.toml").decode())
    assert said["wheels"] == [f"./{wheel}"]
    own = {str(each.relative_to(EXTENSION)) for each in EXTENSION.rglob("*.py")}
    assert set(names) == own | {"blender_manifest.toml", "LICENSE", wheel}


def test_what_needs_no_blender_does_not_ask_for_it() -> None:
    """Nor does any module name the extension's package, which Blender calls otherwise."""
    for each in EXTENSION.rglob("*.py"):
        text = each.read_text("utf-8")
        assert not re.search(r"^\s*(from|import) splatbus_blender", text, re.M), each
        if each.parent.name == "core" or each.stem in ("__init__", "reading", "viewing"):
            assert not re.search(r"^\s*(from|import) (bpy|gpu|mathutils)", text, re.M), each


def test_it_outlives_files_undo_and_disabling(archive: Path, tmp_path: Path) -> None:
    def render(view: View) -> Any:
        return planes(view.poses.camera, view.width, view.height)

    with serving(render) as where:
        ports = {name: where[name] for name in ("SPLATBUS_IPC_PORT", "SPLATBUS_MSG_PORT")}
        # Of the archive alone: nothing of this checkout is in the path.
        told = ran("lifecycle.py", tmp_path, str(archive), **ports, PYTHONPATH="")
    assert told.count("SplatBus: there is no connection to a server") == 1
    assert "check_enabled_again_it_is_as_before" in told
