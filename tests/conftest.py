"""For every test: Hypothesis has no deadline, since a machine that is busy is no defect.

And none may leave other arithmetic behind than IEEE 754's, as a library that was linked with
-ffast-math does to the process that loads it.
"""

import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")


@pytest.fixture(autouse=True)
def _subnormal_numbers_stay() -> Iterator[None]:
    yield
    assert sys.float_info.min / 2 > 0, "this test made the processor flush subnormal numbers to 0"
