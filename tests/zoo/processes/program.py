"""Makes of the reference what a specimen is, and runs it."""

import importlib
from collections.abc import Callable

from tests.zoo.faults.patching import Patch
from tests.zoo.mutant import Specimen

Program = Callable[[list[str]], int]
"""Takes arguments of a command line, and gives the exit status."""


def altered(specimen: Specimen) -> Program:
    """Alter this process to the specimen's taste, and give the program that it alters.

    That is imported afterwards, if it was not before (`tests.zoo.preload`), and no other is.
    """
    specimen.alter(Patch())
    client = "splatbus_viewer.adapter" if specimen.axes else "splatbus_viewer.cli"
    program = "splatbus_renderer.cli" if specimen.side == "server" else client
    main: Program = importlib.import_module(program).main
    return main
