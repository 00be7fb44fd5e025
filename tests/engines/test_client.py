"""The whole clients: judged by the harness, and without garbage."""

import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.conformance.harness import run
from tests.conformance.images.cuda_stand_in.library import library
from tests.engines.built import Command, built, language_of
from tests.engines.judging import WHOLE_SECONDS, check_conforms
from tests.engines.stage import HEIGHT, WIDTH, serving

pytestmark = pytest.mark.apart

FRAMES = {"csharp": 5_000, "cpp": 2_500}
"""The C++ client's allocations are counted one by one."""
SMALL_NURSERY = {"MONO_GC_PARAMS": "nursery-size=64k"}
"""Bytes of garbage after which the collector runs, as it does for one object of 24 a frame.

With 16k, and such an object a frame, it did not run at all in every fourth process.
"""
AXES = {"csharp": "unity", "cpp": "unreal"}


def test_it_conforms(language: str, folder: Path) -> None:
    command = [*built(language, "Adapter", folder), AXES[language]]
    words = ["client", "--adapter", " ".join(command), "--shrink", "0", "--profile", "brief"]
    level = "L2"
    if language == "cpp":  # which reads memory of a GPU too
        library()
        words, level = [*words, "--stand-in-cuda"], "L3"
    status, told = run(*words, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert f"\nconforming at {level}: " in told


def test_the_viewer_conforms_in_what_an_adapter_does_not_show(language: str, folder: Path) -> None:
    """It sends poses unasked, and has words for each event."""
    check_conforms(" ".join(built(language, "Viewer", folder)))


def test_a_stream_of_the_programs_own_reads_what_is_lent(cpp_adapter: Command) -> None:
    """It waits for the image, and the lease's end for it."""
    library()
    command = shlex.join([*cpp_adapter, "opengl", "device"])
    about = ("BUF-11", "CUD-5", "CHN-18", "CHN-24", "INI-8", "IMG-8", "IMG-13", "IMG-14")
    words = ("client", "--adapter", command, "--stand-in-cuda", "--select", ",".join(about))
    status, told = run(*words, "--shrink", "0", limit=WHOLE_SECONDS)
    assert status == 0, told
    assert f"\nconforming at L3: {len(about)} of " in told


def test_the_frame_loop_leaves_no_garbage(program: Command) -> None:
    """In neither thread, with a pose for each image."""
    frames = FRAMES[language_of(program)]
    color, depth = np.full((HEIGHT, WIDTH, 4), 0.5), np.full((HEIGHT, WIDTH), 2.0)
    with serving(lambda _: (color, depth), on_and_on=True) as where:
        line = [*program, "--frames", str(frames)]
        done = subprocess.run(
            line, capture_output=True, text=True, timeout=240, env=where | SMALL_NURSERY
        )
    found = re.match(r"(\d+) frames, (\d+) (?:collections|allocations), ", done.stdout)
    assert found, done.stdout + done.stderr
    assert (int(found[1]), int(found[2])) == (frames, 0)
