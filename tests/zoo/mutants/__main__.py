"""`python -m tests.zoo.mutants NAME …`: run a mutant, or a variation.

What follows NAME is for the command of the reference client, its adapter or server that it alters.
"""

import sys

from tests.zoo.processes.program import altered
from tests.zoo.registry import specimen_named

specimen = specimen_named(sys.argv[1]) if len(sys.argv) > 1 else None
if specimen is None:
    sys.exit("usage: mutants NAME …, with a NAME that `conformance/KILL_MATRIX.md` has")
sys.exit(altered(specimen)(sys.argv[2:]))
