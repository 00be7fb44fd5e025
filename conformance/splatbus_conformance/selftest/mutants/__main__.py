"""`python -m splatbus_conformance.selftest.mutants NAME …`: run a mutant, or a variation.

What follows NAME is for the command of the reference client, its adapter or server that it alters.
"""

import importlib
import os
import sys
import threading

from splatbus_conformance.selftest.patching import Patch
from splatbus_conformance.selftest.zoo import specimen_named

MOST_SECONDS = 300.0
"""A specimen ends by itself after this time, whatever becomes of the harness."""

specimen = specimen_named(sys.argv[1]) if len(sys.argv) > 1 else None
if specimen is None:
    sys.exit("usage: mutants NAME …, with a NAME that `splatbus-conformance selftest` prints")
end = threading.Timer(MOST_SECONDS, os._exit, (1,))
end.daemon = True
end.start()
specimen.alter(Patch())
# Only what runs is imported: a specimen is started some two thousand times in a selftest.
client = "splatbus_client.adapter" if specimen.axes else "splatbus_client.cli"
program = "splatbus_server.cli" if specimen.side == "server" else client
sys.exit(importlib.import_module(program).main(sys.argv[2:]))
