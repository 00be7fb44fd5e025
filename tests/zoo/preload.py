"""Imported once, before specimens of the zoo are forked: the references, and all that alters them.

Not for those that are made by machine, whose modules are changed while they are imported.
"""

import gc

import splatbus_renderer.cli
import splatbus_viewer.adapter
import splatbus_viewer.cli
from splatbus_conformance.cases.drawing import know_all_modules

from tests.simulation import session
from tests.zoo.registry import specimens

__all__ = ["splatbus_renderer", "splatbus_viewer", "session"]

specimens()
know_all_modules()
gc.collect()
gc.freeze()
