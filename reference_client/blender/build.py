"""Builds the extension that Blender installs: its modules, and the client as a wheel inside.

    python reference_client/blender/build.py [FOLDER]

writes splatbus-VERSION.zip into the folder, or this one. It needs `build` and hatchling, which the
extra `dev` of this repository has.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

if sys.version_info < (3, 11):
    sys.exit(f"Python 3.11 or newer is needed, and this is {sys.version.split()[0]}")
import tomllib

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
EXTENSION = HERE / "splatbus_blender"
MANIFEST = "blender_manifest.toml"
_STAMP = (1980, 1, 1, 0, 0, 0)  # so that the same sources make the same archive


def built(folder: Path) -> Path:
    """Build the archive, and return where it is.

    Raises:
        CalledProcessError: the wheel could not be built.
        ValueError: it is not the one that the manifest names.
    """
    manifest = tomllib.loads((EXTENSION / MANIFEST).read_text("utf-8"))
    sources = [EXTENSION / MANIFEST, *sorted(EXTENSION.rglob("*.py"))]
    files = {str(each.relative_to(EXTENSION)): each.read_bytes() for each in sources}
    files["LICENSE"] = (ROOT / "LICENSE").read_bytes()
    with tempfile.TemporaryDirectory() as place:
        wheel = _wheel(Path(place))
        if manifest["wheels"] != [f"./wheels/{wheel.name}"]:
            raise ValueError(f"{MANIFEST} names {manifest['wheels']}, and this is {wheel.name}")
        files[f"wheels/{wheel.name}"] = wheel.read_bytes()
    archive = folder / f"{manifest['id']}-{manifest['version']}.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as to:
        for name, content in files.items():
            info = zipfile.ZipInfo(name.replace("\\", "/"), _STAMP)
            info.compress_type = zipfile.ZIP_DEFLATED
            to.writestr(info, content)
    return archive


def _wheel(folder: Path) -> Path:
    probe = [sys.executable, "-I", "-c", "import build, hatchling"]
    if subprocess.run(probe, stderr=subprocess.DEVNULL).returncode:
        sys.exit(f"first install what builds it: {sys.executable} -m pip install build hatchling")
    words = ("--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT))
    # Isolated: in this folder, or where it is in the path, this file would be taken for `build`.
    line = [sys.executable, "-I", "-m", "build", *words]
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL)
    (wheel,) = folder.glob("*.whl")
    return wheel


if __name__ == "__main__":
    print(built(Path(sys.argv[1]) if len(sys.argv) > 1 else Path()))
