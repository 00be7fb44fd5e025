"""Mutants that break MEM: what they announce of their memory, and how they make it."""

import mmap
import os
from contextlib import ExitStack

from splatbus_conformance.wire.messages import EXAMPLE_HANDLE
from splatbus_server.memory import Memory
from splatbus_server.shared_memory import DIRECTORY, Segment
from splatbus_wire.messages import OpenFailed

from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import OF_THIS_RUN, messages
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.neg.clients import without


def announces(patch, **changes):
    """Change members of the init packet, or of objects in it where a change is an object too."""

    def changed(message):
        if "meta" not in message:
            return message
        inner = {n: message[n] | new for n, new in changes.items() if isinstance(new, dict)}
        return message | changes | inner

    messages(patch, changed)


@mutant("MEM-1", code="missing-member")
def server_counts_no_generations(patch):
    """Leaves the generation out of the init packet."""
    messages(patch, without("generation"))


@mutant("MEM-1", code="bad-string")
def server_announces_version_1_0(patch):
    """Names 1.0 in the init packet of 1.1."""
    announces(patch, version="1.0")


@mutant("MEM-1", check="check_speaks_the_version_that_it_announces", code="wrong-version")
def server_announces_version_1_2(patch):
    """Names 1.2 in the init packet, of which it knows nothing."""
    announces(patch, version="1.2")


@mutant("MEM-2", code="bad-string")
def server_names_a_path(patch):
    """Announces where the memory lies, not what it is called."""
    announces(patch, memory={"name": "/dev/shm/splatbus"})


@mutant("MEM-2", code="out-of-range")
def server_does_not_count_bytes(patch):
    """Announces memory of no bytes."""
    announces(patch, memory={"bytes": 0})


@mutant("MEM-3", code="stray-member")
def server_announces_a_handle_as_well(patch):
    """Puts a CUDA handle beside memory of the host."""
    announces(patch, mem_color=EXAMPLE_HANDLE.decode())


@mutant("MEM-8", code="out-of-range")
def server_counts_slots_from_zero(patch):
    """Announces a ring without slots."""
    announces(patch, ring={"slots": 0})


@mutant("MEM-8", code="out-of-range")
def server_has_odd_strides(patch):
    """Announces a stride that no 16 bytes fit into."""
    announces(patch, ring={"colorStride": 16 * 64 * 48 + 4})


@mutant("MEM-9", code="overlapping")
def server_lays_depth_over_colour(patch):
    """Announces depth where colour begins."""
    announces(patch, ring={"depthOffset": 0})


@mutant("MEM-9", code="beyond-memory")
def server_announces_too_little(patch):
    """Announces memory that ends before its slots do."""
    announces(patch, memory={"bytes": 4096})


@mutant("MEM-12", code="missing-member")
def server_does_not_say_what_it_means(patch):
    """Leaves the semantics out of the init packet."""
    messages(patch, without("semantics"))


@mutant("MEM-12", code="wrong-value")
def server_has_an_alpha_of_its_own(patch):
    """Announces a kind of alpha that is not in the table."""
    announces(patch, semantics={"alpha": "inverted"})


@mutant("MEM-12", code="wrong-value")
def server_has_an_empty_depth_that_no_pixel_holds(patch):
    """Announces an empty depth that single precision rounds to infinity."""
    depth = {"kind": "planar_z", "estimator": "expected", "empty": 1e39}
    announces(patch, semantics={"depth": depth})


@mutant(
    "MEM-4", check="check_lets_only_its_user_in", code="others-may-open", at=server.CREATES_SEGMENT
)
def server_lets_everybody_read(original, size, *prefix):
    """Makes its memory readable for all users."""
    segment: Segment = original(size, *prefix)
    (DIRECTORY / segment.name).chmod(0o644)
    return segment


@mutant(
    "MEM-4", check="check_creates_memory_of_its_own", code="not-its-own", at=server.CREATES_SEGMENT
)
def server_uses_memory_that_it_finds(original, size, *prefix):
    """Has one name for its memory, and takes what has that name."""
    path = DIRECTORY / f"{OF_THIS_RUN}found"
    with ExitStack() as cleanup:
        cleanup.callback(path.unlink, missing_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        os.ftruncate(file, size)
        return Segment(path.name, memoryview(mmap.mmap(file, size)), cleanup.pop_all())


def resizes(memory, factor):
    """Change the size of shared memory that was announced."""
    announced = memory.init_packet.memory
    name, size = getattr(announced, "name", ""), getattr(announced, "bytes", 0)
    if (DIRECTORY / name).is_file():
        os.truncate(DIRECTORY / name, int(size * factor))


@mutant("MEM-5", check="check_keeps_the_size", code="size-changed", at=server.FREES_MEMORY)
def server_truncates_its_memory_at_the_end(original, self):
    """Makes its memory empty before it removes it."""
    resizes(self, 0)
    original(self)


@mutant("MEM-5", check="check_keeps_the_size", code="size-changed", at=server.HEARS_OF_MEMORY)
def server_makes_room(original, self, connection, message):
    """Makes its memory larger for a client that could not open it."""
    memory = self.exchange.memory
    if isinstance(message, OpenFailed) and isinstance(memory, Memory):
        resizes(memory, 2)
    return original(self, connection, message)
