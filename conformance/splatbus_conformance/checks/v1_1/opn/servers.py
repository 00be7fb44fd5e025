"""Checks on how servers keep memory, and let it go (spec 1.1 chapter 4)."""

import os

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.images.memory.reading import LINUX_FOLDER
from splatbus_conformance.trials.moves.frame_readers import LENDS, answer_and_leave, beside, holding
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.os_evidence import owner
from splatbus_conformance.trials.testee.process import FORCE, Ended
from splatbus_conformance.wire.messages import encode, says_of
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

SAFE: int = LIMITS["max_safe_integer"]

GONE_SECONDS = 2.0


@check(
    "OPN-8", observable="a reader's images while others say that they are done", on={SERVER: LENDS}
)
def check_keeps_memory_while_somebody_has_it(trial: ServerTrial) -> None:
    """One reader holds an image; others open the same memory, close it, fail, and leave."""
    holder, frame = holding(trial)
    memory = trial.viewer.with_(holder).memory
    assert memory is not None
    slot, size = int(frame["slot"]), memory.size()
    color, depth = memory.color(slot).tobytes(), memory.depth(slot).tobytes()
    for answer in trial.each(("closed", "open_failed", "opened")):
        answer_and_leave(trial, beside(trial, holder), memory.generation, answer)
        told = f"after another reader's {answer}"
        trial.expect(
            not holder.ended, "another-closed", f"{told} the connection of the first was closed"
        )
        trial.expect(
            memory.size() == size, "size-changed", f"{told} the memory has {memory.size()} bytes"
        )
        same = (color, depth) == (memory.color(slot).tobytes(), memory.depth(slot).tobytes())
        trial.expect(
            same, "written-while-held", f"{told} the image that the first holds is another"
        )
        trial.delivered += 1
    trial.viewer.release(holder, frame)
    trial.viewer.with_(holder).holds = False
    seen = trial.sees(holder, trial.move())
    trial.expect(seen, "no-frame", "after the others had left, the first was sent no further image")


@check("OPN-9", observable="the names that are left", on={SERVER: ("opens",)}, may_crash=True)
def check_leaves_no_memory_behind(trial: ServerTrial) -> None:
    """The server is asked to end; started again, and killed; and started again."""
    if not LINUX_FOLDER.is_dir():
        trial.not_observable("this system does not list shared memory")
    if not trial.testee.expendable:
        trial.not_observable("only a server that the harness launches can be ended")
    name = announced(trial)
    ended = trial.testee.stop()
    if ended is not None and not ended.crashed:
        removed = gone(trial, name, 0.0)  # later another may remove it, which was started beside
        trial.expect(removed, "memory-left-behind", f"{name} is left although the server {ended}")
        trial.delivered += 1
    else:  # it does not heed what it was asked: that was a kill
        expect_sweep(trial, name, ended)
    connection = trial.reading()
    memory = trial.viewer.with_(connection).memory
    assert memory is not None
    left = memory.name
    expect_sweep(trial, left, kill(trial, connection))


def kill(trial: ServerTrial, connection: Connection) -> Ended:
    """Kill the process at the other end of a connection, as a user does who is in a hurry."""
    process = owner(connection.testee_port, connection.port)
    if process is None or not trial.testee.expendable:
        trial.not_observable("the process that serves cannot be found here, or not be killed")
    trial.killed = True
    os.kill(process, FORCE)
    trial.wait(trial.testee.ended)
    ended = trial.testee.ended()
    if ended is None:
        trial.not_observable("the launched command outlives the process that serves")
    return ended


def announced(trial: ServerTrial) -> str:
    """The name of the memory that the server announces now."""
    memory = trial.viewer.with_(trial.reading()).memory
    assert memory is not None
    if not (LINUX_FOLDER / memory.name).exists():
        trial.not_observable("its memory is not listed by the system")
    return memory.name


def expect_sweep(trial: ServerTrial, left: str, ended: Ended | None) -> None:
    """The server is started again, and has removed what the killed one left."""
    trial.peer.close_all()
    if announced(trial) != left:
        told = f"{left} is left by a server that {ended or 'ended'}, after another start"
        trial.expect(gone(trial, left), "memory-not-swept", told)
    trial.delivered += 1


def gone(trial: ServerTrial, name: str, seconds: float = GONE_SECONDS) -> bool:
    """Whether shared memory is removed, within this time; if not, it is removed here."""
    path = LINUX_FOLDER / name
    trial.peer.until(lambda: not path.exists(), seconds)
    is_gone = not path.exists()
    path.unlink(missing_ok=True)
    return is_gone


ANSWERS = st.sampled_from(("opened", "open_failed", "closed"))


@check(
    "OPN-12",
    observable="the server goes on after such answers",
    on={SERVER: ("1.1",)},
    cases=Cases(drawn=st.tuples(ANSWERS, st.integers(1, SAFE), st.booleans()), quick=12, full=300),
)
def check_ignores_generations_that_it_did_not_announce(
    trial: ServerTrial, case: tuple[str, int, bool]
) -> None:
    """`opened`, `open_failed` and `closed` of other generations, with and without memory."""
    kind, generation, reads = case
    connection = trial.ready("ipc") if reads else trial.ready("ipc", capabilities=[])
    memory = trial.viewer.with_(connection).memory
    if memory is None or memory.generation != generation:
        outcome = trial.outcome(connection, packet(encode(says_of(generation, kind))))
        trial.judge(outcome, f"{kind} of generation {generation}, which was not announced")
    connection.close()
