"""Mutants that break OPN: when they announce memory, keep it, and let it go."""

import subprocess
import sys

from splatbus_conformance.images.memory.reading import LINUX_FOLDER
from splatbus_server import api
from splatbus_server.connection import Refusal
from splatbus_server.memory import Memory
from splatbus_wire.messages import Closed, Opened

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import OF_THIS_RUN, crash
from tests.zoo.mutant import mutant


@mutant("OPN-7", code="not-granted", through="IMG-23", at=server.HEARS_OF_MEMORY)
def server_announces_again(original, self, connection, message):
    """Sends another init packet to who has opened the first, and declared no reinit."""
    refusal = original(self, connection, message)
    if isinstance(message, Opened) and not connection.has("reinit"):
        connection.send(self.exchange.memory.init_packet._replace(generation=2))
    return refusal


@mutant(
    "OPN-8",
    check="check_keeps_memory_while_somebody_has_it",
    code="written-while-held",
    at=server.HEARS_OF_MEMORY,
)
def server_reuses_memory_that_one_reader_closed(original, self, connection, message):
    """Takes one reader's `closed` for everybody's, and clears the memory for something else."""
    if isinstance(message, Closed):
        memory = self.exchange.memory
        assert isinstance(memory, Memory)
        for slot in range(memory.ring.slots):
            memory.color(slot)[:] = 0.25
    return original(self, connection, message)


def calls_its_memory_otherwise(patch):
    """Give memory a name that the reference server does not remove when it starts beside."""
    server.CREATES_SEGMENT.wrap(patch, lambda create, size, *_: create(size, OF_THIS_RUN))


@mutant("OPN-9", check="check_leaves_no_memory_behind", code="memory-not-swept")
def server_leaves_what_a_killed_one_left(patch):
    """Does not look for what an earlier run has left."""
    calls_its_memory_otherwise(patch)
    Seam(api, "sweep_stale").replace(patch, list)


@mutant("OPN-9", check="check_leaves_no_memory_behind", code="memory-left-behind")
def server_leaves_memory_to_the_next(patch):
    """Does not remove its memory when it ends: the next one will."""
    calls_its_memory_otherwise(patch)
    server.REMOVES_SEGMENT.replace(patch, lambda segment, owner: None)


@mutant("OPN-9", check="check_leaves_no_memory_behind", code="memory-left-behind")
def server_leaves_memory_to_a_neighbour(patch):
    """The same; another that is started beside it removes what it has left."""
    calls_its_memory_otherwise(patch)

    def remove(segment, owner):
        path = LINUX_FOLDER / segment.name
        sweep = f"import os, time; time.sleep(0.5); os.unlink({str(path)!r})"
        subprocess.Popen([sys.executable, "-c", sweep], start_new_session=True)

    server.REMOVES_SEGMENT.replace(patch, remove)


IGNORES = "check_ignores_generations_that_it_did_not_announce"


@mutant("OPN-12", check=IGNORES, code="closes", at=server.HEARS_OF_MEMORY)
def server_closes_at_unknown_generations(original, self, connection, message):
    """Ends a connection that names a generation which was not announced."""
    refusal = original(self, connection, message)
    if isinstance(refusal, Refusal) and refusal.code == "invalid_message":
        connection.end("there is no such generation", 0.0)
    return refusal


@mutant("OPN-12", check=IGNORES, code="dies", at=server.HEARS_OF_MEMORY)
def server_dies_of_unknown_generations(original, self, connection, message):
    """Takes a generation for an index."""
    reader = self.readers.get(connection)
    if reader is None or message.generation not in reader.announced:
        crash()
    return original(self, connection, message)
