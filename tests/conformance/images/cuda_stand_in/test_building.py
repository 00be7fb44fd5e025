"""How the library is built, and what is said where it cannot be."""

import ctypes
import os
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


def test_the_sources_are_short_and_free_of_warnings(tmp_path: Path) -> None:
    library()
    folder = Path(building.__file__).parent
    sources = sorted(folder.glob("*.c"))
    compiler = os.environ.get("CC", "cc").split()
    subprocess.run([*compiler, *STRICT, *map(str, sources)], check=True, cwd=tmp_path)
    texts = [path.read_text("utf-8") for path in (*sources, *folder.glob("*.h"))]
    assert sum(bool(line.strip()) for text in texts for line in text.splitlines()) < 1000


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


def test_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(NotAvailable, match="'no-such-compiler': install one"):
        library_folder()


def test_a_compiler_that_fails_is_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("CC", "cc --no-such-option")
    with pytest.raises(NotAvailable, match="no-such-option"):
        library_folder()
    assert not list((tmp_path / "splatbus-conformance").iterdir())


def test_it_is_for_linux(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(NotAvailable, match="runs on Linux"):
        library_folder()
