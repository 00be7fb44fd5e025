"""`python -m splatbus_conformance.selftest.mutants NAME …`: run a mutant, or a variation.

What follows NAME is for the command of the reference client, its adapter or server that it alters.
"""

import os
import sys
import threading

import pytest
from splatbus_client.adapter import main as adapter
from splatbus_client.cli import main as client
from splatbus_server.cli import main as server

from splatbus_conformance.selftest.specimen import Mutant, Variation
from splatbus_conformance.selftest.zoo import mutants, variations

MOST_SECONDS = 300.0
"""A specimen ends by itself after this time, whatever becomes of the harness."""

specimens: dict[str, Mutant | Variation] = {
    **{mutant.name: mutant for mutant in mutants()},
    **{variation.name: variation for variation in variations()},
}
if len(sys.argv) < 2 or sys.argv[1] not in specimens:
    sys.exit(f"usage: mutants NAME …, with a NAME of: {', '.join(specimens)}")
end = threading.Timer(MOST_SECONDS, os._exit, (1,))
end.daemon = True
end.start()
specimen = specimens[sys.argv[1]]
specimen.alter(pytest.MonkeyPatch())
main = server if specimen.side == "server" else adapter if specimen.axes else client
sys.exit(main(sys.argv[2:]))
