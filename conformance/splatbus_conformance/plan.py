"""The plan of a run: what the command line asks for, as data that another process can be given."""

from dataclasses import dataclass
from typing import Literal

Side = Literal["client", "server"]
"""Which of the two the testee is."""


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
    select: tuple[str, ...] = ()
    allow_crash: bool = False
    adapter: str | None = None
    """The command that starts an adapter, which starts the testee (conformance/ADAPTER.md)."""

    @property
    def starts_it(self) -> bool:
        """The harness starts the testee itself."""
        return bool(self.launch or self.adapter)


class Usage(Exception):  # noqa: N818 - a finding, no error of ours
    """What was asked for cannot be carried out; the message says why and what to do."""


class NoVerdict(Exception):  # noqa: N818 - a finding, no error of ours
    """The testee could not be met; the message says what to look at."""
