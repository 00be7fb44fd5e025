"""Imported once, before processes are forked: all that each harness or worker would import."""

import gc

from splatbus_conformance.cases.drawing import know_all_modules
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.cli import main
from splatbus_conformance.rules import all_rules
from splatbus_conformance.run import running, workers

__all__ = ["main", "running", "workers"]

for side in ("client", "server"):
    checks_of(side)
all_rules()
know_all_modules()
gc.collect()
gc.freeze()  # nothing of this is garbage in any of them, so none has to look through it
