"""Allowed variations: clients that are unusual, and conform. The harness must pass them."""

import pytest

from splatbus_conformance.selftest.specimen import variation
from splatbus_conformance.selftest.surgery import messages


@variation()
def members_that_nobody_knows(patch: pytest.MonkeyPatch) -> None:
    """Adds members of its own to every message."""
    messages(patch, lambda message: message | {"x-engine": {"frame": [1, None, {"deep": True}]}})
