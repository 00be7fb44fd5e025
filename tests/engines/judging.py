"""The harness judges what shows its images by itself, an engine's component or a viewer."""

import shlex
import sys

from tests.conformance.harness import run
from tests.engines import refreshed

OF_A_VIEWER = (
    *("CTL-6", "NEG-5", "NEG-9"),
    *("CHN-19", "CHN-20", "INI-13", "NEG-24", "JSN-9"),
)
"""What an adapter does not show of the client inside, which is judged whole by itself."""
WHOLE_SECONDS = 600


def check_conforms(viewer: str, *commands: str) -> None:
    """By the harness, as a stranger's; with commands, one that is refreshed."""
    on_a_stub = (sys.executable, "-m", refreshed.__name__, viewer, *commands)
    line = shlex.join(on_a_stub) if commands else viewer
    about = ("--select", ",".join(OF_A_VIEWER), "--profile", "brief", "--shrink", "0")
    status, told = run("client", "--launch", line, *about, limit=WHOLE_SECONDS)
    assert status == 0, told
    assert f"\nconforming at L1: {len(OF_A_VIEWER)} of " in told
