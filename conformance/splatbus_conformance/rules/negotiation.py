"""Rules (to be written)."""

from splatbus_conformance.rules import Rule

RULES: tuple[Rule, ...] = ()
