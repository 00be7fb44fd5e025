"""How many instances of a testee do well beside each other on this machine, as busy as it is."""

import math
import os
import sys
from pathlib import Path

from splatbus_conformance.run.testbed import Testbed
from splatbus_conformance.trials.testee.client_probe import SLOW_SECONDS
from splatbus_conformance.trials.testee.os_evidence import PROC, members, wanted_seconds

MOST, MOST_SLOW = 6, 18
"""More than cores: most of the time a check waits; most of all for one that takes its time, and not
that of a processor, until it is there.
"""
GLANCE_SECONDS = 0.3
SHARE_OF_CORES, SHARE_OF_MEMORY = 0.5, 0.5
"""How much of the machine all instances may take together while they are left alone."""


def at_a_time(testbed: Testbed) -> int:
    """How many instances to judge at a time: one, where what they take cannot be seen.

    What one wants of the processors counts, and not what it gets: the busier the machine is with
    other work, the fewer there are.
    """
    group = testbed.testee.group
    if group is None:
        return 1
    testbed.testee.ensure_running()
    before = wanted_seconds(group)
    testbed.peer.pump(GLANCE_SECONDS)
    busy, resident = (wanted_seconds(group) - before) / GLANCE_SECONDS, _resident_bytes(group)
    if not (before and resident):
        return 1
    by_cores = SHARE_OF_CORES * (os.cpu_count() or 1) / max(busy, 0.01)
    by_memory = SHARE_OF_MEMORY * _free_bytes() / resident
    by_device = SHARE_OF_MEMORY * testbed.device.fits() if testbed.device else math.inf
    most = MOST_SLOW if testbed.facts.waited_for - before >= SLOW_SECONDS else MOST
    return max(1, int(min(most, by_cores, by_memory, by_device)))


def _resident_bytes(group: int) -> int:
    """What the processes of a group hold in memory."""
    if sys.platform == "win32":
        return 0
    pages = 0
    for pid in members(group):
        fields = _read(PROC / str(pid) / "statm").split()
        pages += int(fields[1]) if len(fields) > 1 else 0
    return pages * os.sysconf("SC_PAGE_SIZE") if pages else 0


def _free_bytes() -> int:
    for line in _read(PROC / "meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            return 1024 * int(line.split()[1])
    return 0


def _read(path: Path) -> str:
    try:
        return path.read_text("utf-8", "replace")
    except OSError:
        return ""
