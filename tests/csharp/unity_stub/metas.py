"""The `.meta` files of the Unity package; `python -m tests.csharp.unity_stub.metas` renews them.

Unity knows an asset by the GUID in the file beside it, and makes none in a package that came from a
Git URL: what has no such file it leaves out. What others made refers to an asset by its GUID, which
therefore stays: who moves an asset moves the file beside it, too.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

from splatbus_schemas.prose import CHECKOUT

PACKAGE = CHECKOUT / "reference_client" / "csharp"


def assets(folder: Path = PACKAGE) -> Iterator[Path]:
    """All that Unity imports, folders too: nothing whose name begins with `.` or ends with `~`."""
    for each in sorted(folder.iterdir()):
        if each.name.startswith(".") or each.name.endswith(("~", ".meta")):
            continue
        yield each
        if each.is_dir():
            yield from assets(each)


def meta(asset: Path) -> Path:
    """The file that belongs to it."""
    return asset.with_name(asset.name + ".meta")


def text(asset: Path) -> str:
    """What stands in that file; what it does not say of importing is as usual."""
    there = meta(asset).read_text("utf-8") if meta(asset).exists() else ""
    found = re.search("^guid: ([0-9a-f]{32})$", there, re.MULTILINE)
    guid = found[1] if found else uuid4().hex
    return f"fileFormatVersion: 2\nguid: {guid}\n" + "folderAsset: yes\n" * asset.is_dir()


def sources(folder: Path) -> list[Path]:
    """All in C# that Unity finds there and below."""
    return [each for each in assets(folder) if each.suffix == ".cs"]


def main() -> int:
    """Write those that are missing or broken, and remove those whose asset is gone."""
    wanted = {meta(each): text(each) for each in assets()}
    for path in set(PACKAGE.rglob("*.meta")) - wanted.keys():
        path.unlink()
    for path, content in wanted.items():
        path.write_text(content, "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
