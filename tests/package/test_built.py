"""What is built holds what it should, and is the same bytes wherever it is built."""

import os
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.package.building import ROOT, build, copy, digest, tracked

MEBIBYTE = 1 << 20
PACKAGES = {
    "splatbus_schemas": "schemas",
    "splatbus_wire": "schemas",
    "splatbus_server": "reference_server",
    "splatbus_renderer": "reference_server",
    "splatbus_splats": "reference_server",
    "splatbus_client": "reference_client",
    "splatbus_viewer": "reference_client",
    "splatbus_conformance": "conformance",
}
SOURCES = {
    *(".ci", ".gitattributes", ".gitignore", "CHANGELOG.md", "LICENSE", "README.md"),
    *(
        "CONTRIBUTING.md",
        "RELEASING.md",
        "SECURITY.md",
        "constraints.txt",
        "pyproject.toml",
        "action.yml",
    ),
    *("benchmarks", "conformance", "reference_client", "reference_server", "schemas"),
    *("spec", "tests"),
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


def names_in(built: tuple[Path, Path]) -> tuple[set[str], set[str]]:
    """The files in the wheel, and those in the sdist without its top folder."""
    wheel, sdist = built
    with zipfile.ZipFile(wheel) as archive, tarfile.open(sdist) as tape:
        return set(archive.namelist()), {name.split("/", 1)[1] for name in tape.getnames()}


def test_the_sdist_is_the_checkout(files: list[str], built: tuple[Path, Path]) -> None:
    _, inside = names_in(built)
    assert inside == {*files, "PKG-INFO"}
    assert {name.split("/")[0] for name in inside} <= SOURCES | {"PKG-INFO"}


def test_the_wheel_is_these_packages_and_nothing_else(
    files: list[str], built: tuple[Path, Path]
) -> None:
    inside, _ = names_in(built)
    described = {name for name in inside if name.split("/")[0].endswith(".dist-info")}
    assert inside - described == {
        name.removeprefix(f"{folder}/")
        for name in files
        for package, folder in PACKAGES.items()
        if name.startswith(f"{folder}/{package}/")
    }
    assert {Path(name).name for name in described} == {
        *("METADATA", "WHEEL", "RECORD", "entry_points.txt", "LICENSE"),
    }


def test_the_wheel_has_what_each_package_reads_beside_its_modules(
    built: tuple[Path, Path],
) -> None:
    inside, _ = names_in(built)
    data = {name for name in inside if not name.endswith(".py")}
    typed = {f"{package}/py.typed" for package in PACKAGES}
    assert data >= typed
    assert {Path(name).suffix for name in data - typed if ".dist-info/" not in name} <= KINDS
    assert data >= {
        "splatbus_schemas/limits.json",
        "splatbus_schemas/metamodel.schema.json",
        "splatbus_schemas/1.0/requirements.json",
        "splatbus_schemas/1.1/bundle.json",
        "splatbus_schemas/1.1/welcome.schema.json",
        "splatbus_schemas/1.1/examples/welcome.json",
        "splatbus_server/cuda/publish.cu",
        "splatbus_viewer/window/drawing/picture.frag",
        "splatbus_conformance/data/report.schema.json",
        "splatbus_conformance/images/memory/cuda_stand_in/cudart.c",
    }


def test_both_are_small(built: tuple[Path, Path]) -> None:
    wheel, sdist = built
    assert wheel.stat().st_size < 2 * MEBIBYTE
    assert sdist.stat().st_size < 8 * MEBIBYTE


def test_pictures_are_small(files: list[str]) -> None:
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
