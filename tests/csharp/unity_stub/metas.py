"""The `.meta` files of the Unity package; `python -m tests.csharp.unity_stub.metas` renews them.

Unity knows an asset by the GUID in the file beside it, and makes none in a package that came from a
Git URL: what has no such file it leaves out. A GUID here is made of the path, and stays for as long
as the path does.
"""

import sys
from collections.abc import Iterator
from hashlib import md5
from pathlib import Path

from splatbus_schemas.prose import CHECKOUT

PACKAGE = CHECKOUT / "reference_client" / "csharp"


def assets(folder: Path = PACKAGE) -> Iterator[Path]:
    """All that Unity imports, folders too: nothing whose name begins with `.` or ends with `~`."""
    for each in sorted(folder.iterdir()):
        name = each.name
        if name.startswith(".") or name.endswith(("~", ".meta")) or name in ("bin", "obj"):
            continue
        yield each
        if each.is_dir():
            yield from assets(each)


def meta(asset: Path) -> Path:
    """The file that belongs to it."""
    return asset.with_name(asset.name + ".meta")


def text(asset: Path) -> str:
    """What stands in that file; what it does not say of importing is as usual."""
    path = asset.relative_to(PACKAGE).as_posix()
    guid = md5(f"org.splatbus.client/{path}".encode(), usedforsecurity=False).hexdigest()
    return f"fileFormatVersion: 2\nguid: {guid}\n" + "folderAsset: yes\n" * asset.is_dir()


def main() -> int:
    """Write those that are missing or others, and remove those whose asset is gone."""
    wanted = {meta(each): text(each) for each in assets()}
    for path in set(PACKAGE.rglob("*.meta")) - wanted.keys():
        path.unlink()
    for path, content in wanted.items():
        path.write_text(content, "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
