"""What is built holds what it should, and is the same bytes wherever it is built."""

import os
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.package.building import ROOT, build, copy, digest, tracked

MEBIBYTE = 1 << 20
PACKAGES = {
    "schemas": ("splatbus_schemas", "splatbus_wire"),
    "reference_server": ("splatbus_server", "splatbus_renderer", "splatbus_splats"),
    "reference_client": ("splatbus_client", "splatbus_viewer"),
    "conformance": ("splatbus_conformance",),
}
TOP = {
    *(".ci", ".gitattributes", ".gitignore", "CHANGELOG.md", "CONTRIBUTING.md", "LICENSE"),
    *("README.md", "RELEASING.md", "SECURITY.md", "action.yml", "constraints.txt"),
    *("pyproject.toml", "benchmarks", "spec", "tests", *PACKAGES),
}
"""What may lie at the top of the repository, and so of the sdist."""
KINDS = {".py", ".json", ".c", ".h", ".cu", ".html", ".css", ".js", ".j2", ".lua", ".vert", ".frag"}
"""The kinds of files in a wheel, beside `py.typed`."""


@pytest.fixture(scope="module")
def files() -> list[str]:
    return tracked()


@pytest.fixture(scope="module")
def built(files: list[str], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    sources = copy(files, tmp_path_factory.mktemp("sources"))
    return build(sources, tmp_path_factory.mktemp("dist"), TZ="UTC", LC_ALL="C.UTF-8")


def test_the_sdist_is_the_checkout(files: list[str], built: tuple[Path, Path]) -> None:
    with tarfile.open(built[1]) as tape:
        inside = {name.split("/", 1)[1] for name in tape.getnames()}
    assert inside == {*files, "PKG-INFO"}
    assert {name.split("/")[0] for name in files} <= TOP


def test_the_wheel_is_these_packages_with_their_data_and_nothing_else(
    files: list[str], built: tuple[Path, Path]
) -> None:
    with zipfile.ZipFile(built[0]) as archive:
        inside = set(archive.namelist())
    described = {name for name in inside if name.split("/")[0].endswith(".dist-info")}
    packages = [(folder, name) for folder, names in PACKAGES.items() for name in names]
    assert inside - described == {
        name.removeprefix(f"{folder}/")
        for name in files
        for folder, package in packages
        if name.startswith(f"{folder}/{package}/")
    }
    typed = {f"{package}/py.typed" for _, package in packages}
    assert typed <= inside
    assert {Path(name).suffix for name in inside - typed - described} <= KINDS
    assert {Path(name).name for name in described} == {
        *("METADATA", "WHEEL", "RECORD", "entry_points.txt", "LICENSE"),
    }


def test_both_and_the_pictures_are_small(files: list[str], built: tuple[Path, Path]) -> None:
    wheel, sdist = built
    assert wheel.stat().st_size < 2 * MEBIBYTE
    assert sdist.stat().st_size < 8 * MEBIBYTE
    pictures = (".png", ".jpg", ".webp", ".svg")
    sizes = {name: (ROOT / name).stat().st_size for name in files if name.endswith(pictures)}
    assert {name: size for name, size in sizes.items() if size > 150_000} == {}
    assert 0 < sum(sizes.values()) <= 3_000_000


def test_the_sdist_builds_the_same_bytes_elsewhere_and_later(
    built: tuple[Path, Path], tmp_path: Path
) -> None:
    with tarfile.open(built[1]) as tape:
        tape.extractall(tmp_path / "elsewhere", filter="data")
    (sources,) = (tmp_path / "elsewhere").iterdir()
    for path in sorted(sources.rglob("*"), reverse=True):
        os.utime(path, (1_800_000_000, 1_800_000_000))
        path.chmod(0o700 if path.is_dir() or os.access(path, os.X_OK) else 0o600)
    again = build(sources, tmp_path / "dist", TZ="Asia/Kathmandu", LC_ALL="C", PYTHONHASHSEED="7")
    assert [digest(each) for each in again] == [digest(each) for each in built]
