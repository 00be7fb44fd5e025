"""Packed files and glTF: a library makes a plain .ply of them, in another process.

A broken file may end that process, which has limits of memory and time, and not the server.
"""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from splatbus_splats.files import gltf, ply

GLTF = "glTF"
FORMATS = {".spz": "spz", ".sog": "sog", ".ksplat": "ksplat", ".glb": GLTF, ".gltf": GLTF}
"""What a file is, by how its name ends: as gaussforge calls what it reads, or GLTF, which is read
by pygltflib."""
COMPRESSED = "compressed.ply"
BEGINS = (b"\x1f\x8b", b"PK", b"glTF")
"""How some begin, as others do that are none: .spz as gzip, .sog as zip."""
MOST_SECONDS = 300
MOST_BYTES = 8 << 30
"""Of memory, and of the plain file: ten million Gaussians with all harmonics take 7."""


def format_of(path: Path, first: bytes) -> str:
    """The format of a packed file, or glTF; empty for what is read without a library.

    Args:
        path: whose name tells it.
        first: bytes of the file, which tell a compressed .ply from a plain one.
    """
    if path.suffix.lower() == ".ply":
        return COMPRESSED if b"\nproperty uint packed_position" in first else ""
    return FORMATS.get(path.suffix.lower(), "")


def unpack(path: Path, kind: str, plain: Path) -> None:
    """Writes a plain .ply of the same Gaussians.

    Args:
        path: of the file.
        kind: its format, as `format_of` says.
        plain: the file to write.

    Raises:
        ValueError: it cannot be read; the message names it, and why.
        ImportError: what reads it is not installed.
    """
    library = "pygltflib" if kind == GLTF else "gaussforge"
    called = {GLTF: GLTF, COMPRESSED: "compressed .ply"}.get(kind, f".{kind}")
    if find_spec(library) is None:
        raise ImportError(f"{path}: {called} is read by {library}, which is not installed")
    line = (sys.executable, "-m", __name__, str(path), kind, str(plain))
    try:
        done = subprocess.run(line, capture_output=True, errors="replace", timeout=MOST_SECONDS)
    except subprocess.TimeoutExpired:
        raise ValueError(f"{path}: it takes longer than {MOST_SECONDS} s to read") from None
    if done.returncode:
        why = done.stderr.strip().rpartition("\n")[2]
        why = why or f"it is broken: what reads it ended with {done.returncode}"
        raise ValueError(f"{path}: this {called} file cannot be read: {why}")


def main(words: list[str]) -> int:
    """In the process of its own."""
    path, kind, plain = words
    for what, most in (("AS", MOST_BYTES), ("FSIZE", MOST_BYTES), ("CORE", 0)):
        with suppress(ImportError, ValueError, OSError):  # where the system has no such limit
            resource = import_module("resource")
            resource.setrlimit(getattr(resource, f"RLIMIT_{what}"), (most, most))
    try:
        if kind == GLTF:
            ply.write(Path(plain), gltf.read(Path(path)), "Vertical Axis: y")
            return 0
        converter = import_module("gaussforge").GaussForge()
        given = converter.convert(Path(path).read_bytes(), kind, "ply")
        if why := given.get("error"):
            raise ValueError(why)
        if not given["data"]:
            raise ValueError("it is cut short, or of an unknown version")
        Path(plain).write_bytes(given["data"])
    except MemoryError:
        sys.exit("it takes too much memory")
    except (ValueError, OSError) as error:
        sys.exit(str(error))
    except Exception as error:
        sys.exit(f"it is malformed: {type(error).__name__} {error}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
