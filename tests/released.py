"""What each requirement meant at a release: `python -m tests.released` writes it down.

By digests, for what is asked at a change is whether a meaning is still the same. What is final has
no place here: the digests in `spec/final.json` hold all of it.
"""

import json
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from splatbus_schemas import VERSIONS, prose

RELEASED = Path(__file__).parent / "spec" / "released.json"
MEANING = ("level", "binds", "acceptable", "sentence")


def meanings(registry: Mapping[str, Any]) -> dict[str, str]:
    """By id, the start of the SHA-256 of what makes the meaning of a requirement."""
    return {
        each["id"]: sha256(json.dumps([each[it] for it in MEANING]).encode()).hexdigest()[:16]
        for each in registry["requirements"]
    }


if __name__ == "__main__":
    collected = {version: prose.collect(version) for version in VERSIONS}
    open_ones = {k: meanings(it) for k, it in collected.items() if it["status"] != "final"}
    RELEASED.write_text(json.dumps(open_ones, indent=1) + "\n", "utf-8")
