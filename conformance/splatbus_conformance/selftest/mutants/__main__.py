"""`python -m splatbus_conformance.selftest.mutants NAME view …`: run a mutant, or a variation."""

import sys

import pytest
from splatbus_client.cli import main

from splatbus_conformance.selftest.specimen import Mutant, Variation
from splatbus_conformance.selftest.zoo import mutants, variations

specimens: dict[str, Mutant | Variation] = {
    **{mutant.name: mutant for mutant in mutants()},
    **{variation.name: variation for variation in variations()},
}
if len(sys.argv) < 2 or sys.argv[1] not in specimens:
    sys.exit(f"usage: mutants NAME view …, with a NAME of: {', '.join(specimens)}")
specimens[sys.argv[1]].alter(pytest.MonkeyPatch())
sys.exit(main(sys.argv[2:]))
