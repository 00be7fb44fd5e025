"""`python -m tests.released`: hold what has become final, to the letter."""

import json
from hashlib import sha256
from pathlib import Path

from splatbus_schemas import VERSIONS, prose

FINAL = Path(__file__).parent / "spec" / "final.json"


def digests(version: str) -> dict[str, str]:
    """The SHA-256 of each chapter of a version, of its requirements and of its schemas."""
    registry = prose.registry_path(version)
    held = (*prose.chapters(version), registry, *registry.parent.glob("*.schema.json"))
    return {it.name: sha256(it.read_bytes()).hexdigest() for it in held}


if __name__ == "__main__":
    stored = json.loads(FINAL.read_text("utf-8"))
    final = [it for it in VERSIONS if prose.collect(it)["status"] == "final"]
    stored |= {version: digests(version) for version in final if version not in stored}
    FINAL.write_text(json.dumps(stored, indent=1) + "\n", "utf-8")
