"""Imported once, before processes are forked: all that each harness or worker would import."""

import gc

from splatbus_conformance import cli, parallel, running
from splatbus_conformance.coverage import check_functions
from splatbus_conformance.rules import all_rules

__all__ = ["cli", "parallel", "running"]

for side in ("client", "server"):
    check_functions(side)
all_rules()
gc.collect()
gc.freeze()  # nothing of this is garbage in any of them, so none has to look through it
