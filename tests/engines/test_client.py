"""The whole clients: judged at L1 and L2, without garbage, seeing what the Python one sees."""

import json
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_wire.poses import Pose

from tests.conformance.harness import run
from tests.conformance.images.cuda_stand_in.library import library
from tests.engines.built import Command, built
from tests.engines.stage import HEIGHT, WIDTH, Answer, asked, planes, serving

pytestmark = pytest.mark.apart

FRAMES = {"csharp": 5_000, "cpp": 2_500}
"""The C++ client's allocations are counted one by one."""
SMALL_NURSERY = {"MONO_GC_PARAMS": "nursery-size=64k"}
"""Bytes of garbage after which the collector runs, as it does for one object of 24 a frame.

With 16k, and such an object a frame, it did not run at all in every fourth process.
"""
PYTHON = [sys.executable, "-m", "splatbus_viewer.adapter", "--axes"]
AXES = {"csharp": ("unity",), "cpp": ("unreal", "opengl")}
W = 0.9273618495495703
ON_THE_WIRE = Pose((0.5, -1.25, -4.0), (-0.1, 0.2, -0.3, W))
IN_ENGINES = {
    "unity": {"position": [0.5, 1.25, -4.0], "rotation": [0.1, 0.2, 0.3, W]},
    "unreal": {"position": [-400.0, 50.0, 125.0], "rotation": [0.3, 0.1, 0.2, W]},
    "opengl": {"position": [0.5, 1.25, 4.0], "rotation": [-0.1, -0.2, 0.3, W]},
}
LIMIT_SECONDS = 60
WHOLE_SECONDS = 600
"""For a verdict on all; `tests long` judges by the longer profiles."""


def test_it_conforms(language: str, folder: Path) -> None:
    command = [*built(language, "Adapter", folder), AXES[language][0]]
    words = ["client", "--adapter", " ".join(command), "--shrink", "0", "--profile", "brief"]
    level = "L2"
    if language == "cpp":  # which reads memory of a GPU too
        library()
        words, level = [*words, "--stand-in-cuda"], "L3"
    status, told = run(*words, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert f"\nconforming at {level}: " in told


def test_the_viewer_conforms_in_what_an_adapter_does_not_show(language: str, folder: Path) -> None:
    """It sends poses unasked, and has words for each event. The client inside is judged above."""
    about = (*("CTL-6", "NEG-5", "NEG-9"), *("CHN-19", "CHN-20", "INI-13", "NEG-24", "JSN-9"))
    command = " ".join(built(language, "Viewer", folder))
    words = ("client", "--launch", command, "--select", ",".join(about), "--profile", "brief")
    status, told = run(*words, "--shrink", "0", limit=WHOLE_SECONDS)
    assert status == 0, told
    assert f"\nconforming at L1: {len(about)} of " in told


def test_a_stream_of_the_programs_own_reads_what_is_lent(cpp_adapter: Command) -> None:
    """It waits for the image, and the lease's end for it."""
    library()
    command = shlex.join([*cpp_adapter, "opengl", "device"])
    about = ("BUF-11", "CUD-5", "CHN-18", "CHN-24", "INI-8", "IMG-8", "IMG-13", "IMG-14")
    words = ("client", "--adapter", command, "--stand-in-cuda", "--select", ",".join(about))
    status, told = run(*words, "--shrink", "0", limit=WHOLE_SECONDS)
    assert status == 0, told
    assert f"\nconforming at L3: {len(about)} of " in told


def test_the_frame_loop_leaves_no_garbage(language: str, program: Command) -> None:
    """In neither thread, with a pose for each image."""
    color, depth = np.full((HEIGHT, WIDTH, 4), 0.5), np.full((HEIGHT, WIDTH), 2.0)
    with serving(lambda _: (color, depth), on_and_on=True) as where:
        line = [*program, "--frames", str(FRAMES[language])]
        done = subprocess.run(
            line, capture_output=True, text=True, timeout=240, env=where | SMALL_NURSERY
        )
    found = re.match(r"(\d+) frames, (\d+) (?:collections|allocations), ", done.stdout)
    assert found, done.stdout + done.stderr
    assert (int(found[1]), int(found[2])) == (FRAMES[language], 0)


@contextmanager
def adapter(line: list[str], where: dict[str, str]) -> Iterator[Callable[..., Answer]]:
    """Ask a client's adapter one command after the other."""
    with asked(line, where, greets=True) as ask:

        def command(name: str, **members: Any) -> Answer:
            answer = ask(json.dumps({"id": 1, "command": name, **members}))
            assert "error" not in answer, answer
            return answer

        command("start")
        yield command
        command("stop")


@pytest.mark.parametrize("last", [0, -1])
def test_it_sees_what_the_python_client_sees_to_the_bit(
    language: str, last: int, folder: Path
) -> None:
    """Each sends one pose in an engine's axes, to a server whose image hangs on every bit of it."""
    axes = AXES[language][last]
    pose = IN_ENGINES[axes]
    expected = [sha256(plane.tobytes()).hexdigest() for plane in planes(ON_THE_WIRE)]
    for line in ([*PYTHON, axes], [*built(language, "Adapter", folder), axes]):
        drawn = serving(lambda view: planes(view.poses.camera))
        with drawn as where, adapter(line, where) as ask:
            ask("send_camera", **pose)
            until = time.monotonic() + LIMIT_SECONDS
            shown = None
            while shown != expected and time.monotonic() < until:
                image = ask("digest")
                shown = [image.get("color"), image.get("depth")]
        assert shown == expected, line
