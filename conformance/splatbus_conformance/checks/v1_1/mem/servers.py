"""Checks on a server's shared memory itself (spec 1.1 section 3.2)."""

import os

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.memory.reading import LINUX_FOLDER, Opened
from splatbus_conformance.trials.moves.agreement import named
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import says_of
from splatbus_conformance.wire.sockets import Connection

OTHERS = 0o077
"""Permission bits of everybody but the owner."""


def opened(trial: ServerTrial, connection: Connection) -> Opened:
    """The memory that is open on a connection, if its size and mode are shown here."""
    memory = trial.viewer.with_(connection).memory
    if memory is None or memory.size() is None or memory.mode() is None:
        trial.not_observable("this system does not show the size and mode of shared memory")
    return memory


@check("MEM-1", observable="the version that welcome names", on={SERVER: ("opens",)})
def check_speaks_the_version_that_it_announces(trial: ServerTrial) -> None:
    """Says hello anew, with the version of the init packet before 1.1."""
    connection = trial.ready("ipc")
    told = trial.viewer.with_(connection).init_packets
    connection.close()
    announced = told[-1].get("version") if told else None
    if not isinstance(announced, str):
        trial.not_observable("no init packet names a version")
    spoken = named(trial, "ipc", [announced, "1.1"])
    trial.expect(
        spoken == announced,
        "wrong-version",
        f"it announces {show(announced)}, and a client of that version is told {show(spoken)}",
    )
    trial.delivered += 1


@check("MEM-4", observable="the mode of the memory", on={SERVER: ("opens",)})
def check_lets_only_its_user_in(trial: ServerTrial) -> None:
    """Reads the permissions of the memory that is announced."""
    mode = opened(trial, trial.reading()).mode() or 0
    trial.expect(
        mode & OTHERS == 0, "others-may-open", f"others may open the memory: its mode is {mode:04o}"
    )
    trial.delivered += 1


@check("MEM-4", observable="whether it was there before", on={SERVER: ("opens",)}, may_crash=True)
def check_creates_memory_of_its_own(trial: ServerTrial) -> None:
    """Launches the server anew, where a file has the name that its memory had before."""
    memory = opened(trial, trial.reading())
    if not trial.testee.expendable:
        trial.not_observable("only a server that the harness launches can be launched anew")
    path = LINUX_FOLDER / memory.name
    trial.peer.close_all()
    trial.testee.stop()
    path.unlink(missing_ok=True)
    with path.open("xb") as planted:
        path.chmod(0o600)
        try:
            found = file_of(trial)
            same = found == os.fstat(planted.fileno()).st_ino
            trial.expect(not same, "not-its-own", f"{path.name} was there before, and is used")
            trial.delivered += 1
        finally:
            trial.peer.close_all()
            trial.testee.stop()
            path.unlink(missing_ok=True)


def file_of(trial: ServerTrial) -> int | None:
    """The inode of the memory that the server announces now."""
    memory = trial.viewer.with_(trial.reading()).memory
    path = LINUX_FOLDER / memory.name if memory else None
    return path.stat().st_ino if path and path.exists() else None


@check("MEM-5", observable="its size while it is used, and after the end", on={SERVER: ("opens",)})
def check_keeps_the_size(trial: ServerTrial) -> None:
    """The camera moves, readers come and go, one fails to open it; then the server ends."""
    connection = trial.reading()
    memory = opened(trial, connection)
    size = memory.size()
    for message in (
        says_of(memory.generation, "open_failed"),
        says_of(memory.generation, "closed"),
        {"type": "subscribe", "channels": ["depth"]},
    ):
        other = trial.reading()
        trial.viewer.say(other, message)
        trial.move()
        trial.rest(0.02)
        other.close()
        trial.expect(
            memory.size() == size,
            "size-changed",
            f"its size was {size:,}, and is {memory.size():,}",
        )
    if trial.testee.expendable:
        trial.testee.stop()
        now = memory.size()
        trial.expect(
            now == size,
            "size-changed",
            f"its size was {size:,}, and {now:,} after the server ended",
        )
    trial.delivered += 1
