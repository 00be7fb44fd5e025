"""Writes the pages where Sphinx reads them, and the files that lie beside the pages."""

from collections.abc import Mapping, Set
from pathlib import Path

from splatbus_schemas import prose
from splatbus_schemas.editions import PLACES

from . import judged, layout, links, messages, pictures, specification


def pages(root: Path) -> dict[str, str]:
    """Every page by its path in the repository, generated ones by a path that they could have."""
    found = layout.prose(root)
    matrix = found[judged.KILL_MATRIX]
    found[specification.WHOLE["1.0"]] = specification.in_one_piece("1.0", found)
    found[specification.WHOLE["1.1"]] = prose.documents(root)[PLACES[""]]
    for source in specification.REPEATING:
        found[source] = specification.NOT_SEARCHED + found[source]
    return found | {
        specification.INDEX: specification.index(found),
        judged.COVERAGE: judged.coverage(matrix),
        judged.CHECKS: judged.checks(),
        judged.KILL_MATRIX: judged.kill_matrix(matrix),
        pictures.SOURCE: pictures.page(root),
        **messages.pages(),
    }


def stage(root: Path, sources: Path, site: Path) -> None:
    """Lay out the repository at `root`: pages and pictures in `sources`, other files in `site`.

    `sources` holds nothing else afterwards. Only what changed is written, so that Sphinx reads only
    that again.
    """
    found = pages(root)
    names = frozenset(found)
    files = {p.relative_to(root).as_posix() for each in layout.RAW for p in root.glob(each)}
    relinked = {}
    images: set[str] = set()
    for source, text in found.items():
        relinked[source], linked, shown = links.relinked(source, text, names, root)
        files |= linked
        images |= shown
    data = {path: (root / path).read_bytes() for path in files | images}
    texts = {f"{name}.md": text.encode() for name, text in layout.staged(relinked).items()}
    wanted = texts | {path: data[path] for path in images}
    _remove_all_but(wanted.keys(), sources)
    _write(wanted, sources)
    _write({path: data[path] for path in files}, site)


def _remove_all_but(wanted: Set[str], folder: Path) -> None:
    for path in [path for path in folder.rglob("*") if path.is_file()]:
        if path.relative_to(folder).as_posix() not in wanted:
            path.unlink()


def _write(files: Mapping[str, bytes], folder: Path) -> None:
    for name, data in files.items():
        path = folder / name
        if not path.exists() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
