"""What a file is that is no splat file, by its first bytes, and what to do about it."""

from __future__ import annotations

MOST = 512
"""Bytes that are looked at."""
UNPACK = "unpack it, and serve the file that is in it"
EXPORT = "export the Gaussians as a .ply"
KINDS = (
    (b"version https://git-lfs", "a pointer of Git LFS: fetch the file itself with git lfs pull"),
    (b"\x1f\x8b\x08", f"a file packed by gzip: name it .spz if it is one, or {UNPACK}"),
    (b"PK\x03\x04", f"an archive (zip): name it .sog if it is one, or {UNPACK}"),
    (b"7z\xbc\xaf\x27\x1c", f"an archive (7z): {UNPACK}"),
    (b"Rar!", f"an archive (rar): {UNPACK}"),
    (b"BZh", f"a file packed by bzip2: {UNPACK}"),
    (b"\xfd7zXZ", f"a file packed by xz: {UNPACK}"),
    (b"\x28\xb5\x2f\xfd", f"a file packed by zstd: {UNPACK}"),
    (b"glTF", "a glTF: name it .glb"),
    (b"\x89PNG", f"a PNG: {EXPORT}"),
    (b"\xff\xd8\xff", f"a JPEG: {EXPORT}"),
    (b"LASF", f"a cloud of points (LAS): {EXPORT}"),
)
PAGE = "a page of the web, such as one to sign in: download the file itself"


def recognised(first: bytes) -> str:
    """What begins so, if that is known; else nothing.

    Args:
        first: `MOST` bytes of the file, or all.
    """
    for begins, kind in KINDS:
        if first.startswith(begins):
            return kind
    if first[257:262] == b"ustar":
        return f"an archive (tar): {UNPACK}"
    page = first.lstrip().lower().startswith((b"<!doctype html", b"<html"))
    return PAGE if page else ""
