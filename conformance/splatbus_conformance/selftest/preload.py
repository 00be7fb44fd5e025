"""Imported once, before harnesses are forked: all that each of them would import."""

import gc

from splatbus_conformance import cli, running
from splatbus_conformance.coverage import check_functions
from splatbus_conformance.rules import all_rules
from splatbus_conformance.selftest import nursery

__all__ = ["cli", "nursery", "running"]

for side in ("client", "server"):
    check_functions(side)
all_rules()
gc.collect()
gc.freeze()  # nothing of this is garbage in any harness, so none has to look through it
