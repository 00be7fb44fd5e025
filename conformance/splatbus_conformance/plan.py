"""The plan of a run: what the command line asks for, as data that another process can be given."""

from dataclasses import dataclass
from typing import Literal

from splatbus_conformance.selection import ALL, Selection

Side = Literal["client", "server"]
"""Which of the two the testee is."""
SIDES: tuple[Side, Side] = ("client", "server")


@dataclass(frozen=True)
class Plan:
    """Which testee to judge, by what, and how far to go."""

    side: Side
    launch: str | None
    """The command that starts it; None where somebody else does."""
    host: str
    ports: tuple[int, int]
    """IPC and message; 0 for a free one."""
    viewport: tuple[int, int]
    patience: float
    """Longest wait for a connection, in seconds."""
    profile: str = "quick"
    seed: int = 0
    selection: Selection = ALL
    allow_crash: bool = False
    adapter: str | None = None
    """The command that starts an adapter, which starts the testee (conformance/ADAPTER.md)."""
    stand_in_cuda: bool = False
    """What is launched finds the stand-in CUDA runtime (conformance/STAND_IN_CUDA.md)."""
    parallel: int = 1
    """How many testees are judged at a time, each on ports of its own; 0 for as many as do well."""
    within: float = 0.0
    """Seconds that the whole run may take; 0 for as many as it likes."""
    exitfirst: bool = False
    """The run ends with the check in which a MUST was broken."""
    record: str | None = None
    """The folder that keeps what crosses the wire."""

    @property
    def starts_it(self) -> bool:
        """The harness starts the testee itself."""
        return bool(self.launch or self.adapter)


class Usage(Exception):  # noqa: N818 - a finding, no error of ours
    """What was asked for cannot be carried out; the message says why and what to do."""


class NoVerdict(Exception):  # noqa: N818 - a finding, no error of ours
    """The testee could not be met; the message says what to look at."""
