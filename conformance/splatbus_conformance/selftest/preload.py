"""Imported once, before harnesses are forked: all that each of them would import."""

from splatbus_conformance import running
from splatbus_conformance.coverage import check_functions
from splatbus_conformance.rules import all_rules

__all__ = ["running"]

for side in ("client", "server"):
    check_functions(side)
all_rules()
