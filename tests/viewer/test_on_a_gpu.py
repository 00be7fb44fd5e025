"""The client on a GPU that is none: judged at L3, where every call to the driver is seen."""

import importlib.util
import shlex
import sys

import pytest

from tests.conformance.harness import run
from tests.conformance.images.cuda_stand_in.library import library

WHOLE_SECONDS = 600
"""For a verdict on all; it takes 50 where nothing else runs."""


def test_it_conforms_at_l3() -> None:
    if not importlib.util.find_spec("cuda") or not importlib.util.find_spec("cuda.bindings"):
        pytest.skip("cuda-bindings is not installed")
    library()
    adapter = shlex.join([sys.executable, "-m", "splatbus_viewer.adapter"])
    words = ("client", "--adapter", adapter, "--stand-in-cuda", "--profile", "brief")
    status, told = run(*words, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert "\nconforming at L3: " in told
