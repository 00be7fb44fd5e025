"""How the library is built, and what is said where it cannot be."""

import ctypes
import subprocess
from pathlib import Path

import pytest
from splatbus_conformance.images.memory.cuda_stand_in import building
from splatbus_conformance.images.memory.cuda_stand_in.building import (
    DRIVER,
    SONAMES,
    NotAvailable,
    library_folder,
)

from tests.conformance.images.cuda_stand_in.library import library


def test_it_is_built_once_in_every_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = library_folder()
    assert {"libcudart.so", *SONAMES, DRIVER} <= {path.name for path in folder.iterdir()}
    assert folder.is_relative_to(tmp_path)
    assert [path.name for path in folder.parent.iterdir()] == [folder.name], "nothing is left over"
    monkeypatch.setenv("PATH", "")
    assert library_folder() == folder, "no compiler is needed a second time"


STRICT = "-std=c11 -Wall -Wextra -Wconversion -Wshadow -Werror -fsyntax-only".split()


def test_the_sources_are_free_of_warnings() -> None:
    library()
    sources = Path(building.__file__).parent.glob("*.c")
    subprocess.run(["cc", *STRICT, *map(str, sources)], check=True)


@pytest.mark.parametrize("soname", SONAMES)
def test_symbols_have_the_version_that_linked_programs_want(soname: str) -> None:
    loaded = ctypes.CDLL(str(Path(library()).with_name(soname)))
    dlvsym = ctypes.CDLL(None).dlvsym
    dlvsym.restype, dlvsym.argtypes = ctypes.c_void_p, [ctypes.c_void_p] + 2 * [ctypes.c_char_p]
    assert dlvsym(loaded._handle, b"cudaIpcOpenMemHandle", soname.encode())
    assert not dlvsym(loaded._handle, b"cudaIpcOpenMemHandle", b"libcudart.so.9")


def test_the_driver_exports_its_calls_alone() -> None:
    driver = ctypes.CDLL(str(Path(library()).with_name(DRIVER)))
    assert driver.cuIpcOpenMemHandle_v2
    for name in ("cudaIpcOpenMemHandle", "containing", "is_the_driver"):
        assert not hasattr(driver, name)


@pytest.mark.parametrize(
    ("compiler", "why"),
    [
        ("no-such-compiler", "'no-such-compiler': install one"),
        ("cc --no-such-option", "could not be compiled: cc --no-such-option(.|\n)*no-such-option"),
    ],
)
def test_it_says_why_it_could_not_be_built(
    compiler: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("CC", compiler)
    with pytest.raises(NotAvailable, match=why):
        library_folder()
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_it_is_for_linux(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(NotAvailable, match="runs on Linux"):
        library_folder()
