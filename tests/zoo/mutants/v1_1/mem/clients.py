"""Mutants that break MEM: shared memory, rings, what pixels mean."""

import mmap
import os
import re
import stat
from pathlib import Path

from splatbus_client import mapping
from splatbus_client.host_memory import CannotOpenError
from splatbus_wire import fields, init_packet
from splatbus_wire.init_packet import check_fits

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import crash, init_packets
from tests.zoo.mutant import mutant

MEASURES = "check_measures_the_memory"
NAMES = "check_refuses_bad_names"
RING = "check_keeps_the_ring_within_the_memory"
READS = "check_opens_memory_for_reading_only"
MEMBERS = "check_refuses_broken_members"


@mutant("MEM-6", check=MEASURES, code="accepts")
def does_not_measure_the_memory(patch):
    """Answers `opened` without a look at how long the memory is."""
    says_opened(patch, "bytes long")


@mutant("MEM-6", check=MEASURES, code="accepts")
def answers_opened_without_memory(patch):
    """Answers `opened` although there is no such memory."""
    says_opened(patch, "no shared memory")


@mutant("MEM-6", check=MEASURES, code="dies", at=client.OPENS_MEMORY)
def reads_past_the_end_of_the_memory(original, packet):
    """Maps memory that is too short, reads past its end, and is killed."""
    try:
        return original(packet)
    except CannotOpenError as problem:
        if "bytes long" in str(problem):
            crash()
        raise


def says_opened(patch, where):
    """Answer `opened` where the memory cannot be opened for a reason that has these words."""

    def open_failed(original, self, packet, reason):
        if where in reason:
            self.opened(packet)
        else:
            original(self, packet, reason)

    client.SAYS_OPEN_FAILED.wrap(patch, open_failed)


@mutant("MEM-7", check=NAMES, code="accepts")
def opens_any_name(patch):
    """Opens whatever file the name leads to."""
    wire.NAMES_OF_MEMORY.replace(patch, re.compile(".*", re.DOTALL))


@mutant("MEM-7", check=NAMES, code="accepts")
def takes_longer_names(patch):
    """Takes names of up to 255 characters."""
    wire.NAMES_OF_MEMORY.replace(patch, re.compile(r"(?!\.)[A-Za-z0-9._-]{1,255}"))


@mutant("MEM-7", check=NAMES, code="accepts")
def takes_hidden_names(patch):
    """Takes names that begin with a dot."""
    wire.NAMES_OF_MEMORY.replace(patch, re.compile(r"[A-Za-z0-9._-]{1,30}"))


@mutant("MEM-7", check=NAMES, code="accepts")
def takes_a_line_break_after_the_name(patch):
    """Tests names by a pattern that ends in `$`, which a line break may follow."""
    pattern = re.compile(r"(?!\.)[A-Za-z0-9._-]{1,30}\n?")
    wire.NAMES_OF_MEMORY.replace(patch, pattern)


@mutant("MEM-7", check=NAMES, code="accepts")
def takes_letters_beyond_ascii(patch):
    r"""Tests names by `\\w`, which is more than ASCII."""
    wire.NAMES_OF_MEMORY.replace(patch, re.compile(r"(?!\.)[\w.-]{1,30}"))


@mutant("MEM-10", check=RING, code="accepts")
def does_not_compare_the_ring_with_the_memory(patch):
    """Does not compare the ring with the size of the memory."""
    wire.CHECKS_SLOTS.replace(patch, lambda *_: None)


@mutant("MEM-10", check=RING, code="accepts")
def computes_in_64_bits_that_overflow(patch):
    """Takes integers of 64 bits modulo 2⁶⁴."""

    def wrap_around(packet):
        for name, value in packet["ring"].items():
            packet["ring"][name] = value % (1 << 64)

    init_packets(patch, wrap_around)


@mutant("MEM-10", check=RING, code="accepts")
def multiplies_in_64_bits_that_overflow(patch):
    """Computes the end of the ring in 64 bits without a look at overflow."""
    Seam(init_packet, "MAX_SAFE_INTEGER").replace(patch, 1 << 63)

    def check_slots(original, ring, pixels, memory_bytes):
        ends = (
            ring.color_offset + (ring.slots - 1) * ring.color_stride + 16 * pixels,
            ring.depth_offset + (ring.slots - 1) * ring.depth_stride + 4 * pixels,
        )
        if max(end % (1 << 64) for end in ends) > memory_bytes:
            original(ring, pixels, memory_bytes)

    wire.CHECKS_SLOTS.wrap(patch, check_slots)
    Seam(mapping, "extent").replace(patch, lambda packet: packet.memory.bytes)


@mutant("MEM-11", check=MEMBERS, code="accepts")
def takes_any_version_that_begins_with_1(patch):
    """Takes an init packet of any version that begins with 1."""

    _takes_versions(patch, r"1\..*")


@mutant("MEM-18", check="check_takes_later_versions", code="not-opened")
def takes_its_own_version_alone(patch):
    """Takes an init packet of no version but its own."""
    wire.VERSIONS_OF_MEMORY.replace(patch, re.compile(r"1\.1"))


@mutant("MEM-18", check="check_takes_later_versions", code="not-opened")
def takes_minor_versions_of_one_digit(patch):
    """Takes no minor version beyond 9."""
    wire.VERSIONS_OF_MEMORY.replace(patch, re.compile(r"1\.[1-9]"))


@mutant("MEM-11", check=MEMBERS, code="accepts")
def takes_minor_versions_with_leading_zeros(patch):
    """Takes "1.01" for a later version."""
    _takes_versions(patch, r"1\.0[0-9]+")


def _takes_versions(patch, pattern):
    def later(packet):
        if re.fullmatch(pattern, packet["version"]):
            packet["version"] = "1.1"

    init_packets(patch, later)


@mutant("MEM-11", check=MEMBERS, code="accepts")
def takes_any_kind_of_memory(patch):
    """Takes every kind of memory for memory of the host."""
    init_packets(patch, lambda it: it["memory"].update(kind="host_shm"))


@mutant("MEM-11", check=MEMBERS, code="accepts")
def takes_slots_that_overlap(patch):
    """Does not see that slots overlap."""
    Seam(init_packet, "check_overlaps").replace(patch, lambda _: None)


@mutant("MEM-11", check=MEMBERS, code="accepts")
def takes_slots_that_are_not_aligned(patch):
    """Takes offsets that are no multiples of 16."""
    Seam(init_packet, "ALIGNMENT").replace(patch, 1)


@mutant("MEM-11", check=MEMBERS, code="accepts")
def guesses_an_unknown_alpha(patch):
    """Takes an alpha that it does not know for straight."""
    init_packets(patch, lambda it: it["semantics"].update(alpha="straight"))


@mutant("MEM-11", check=MEMBERS, code="accepts")
def takes_an_empty_depth_that_no_pixel_holds(patch):
    """Takes an empty depth that single precision rounds to infinity."""
    Seam(fields, "ROUNDS_TO_INFINITY").replace(patch, float("inf"))


@mutant("MEM-11", check=MEMBERS, code="accepts")
def does_without_semantics(patch):
    """Takes what it likes for granted where the packet does not say what pixels mean."""
    good = {
        "rows": "bottom_up",
        "alpha": "straight",
        "colorSpace": "srgb",
        "depth": {"kind": "planar_z", "estimator": "expected", "empty": "inf"},
        "unitMetres": None,
        "origin": [0, 0, 0],
    }
    init_packets(patch, lambda it: it.setdefault("semantics", good))


@mutant(
    "MEM-11",
    check="check_refuses_generations_that_do_not_grow",
    code="accepts",
    at=client.TAKES_INIT_PACKET,
)
def takes_old_generations(original, self, packet):
    """Takes an init packet whose generation it has seen before."""
    self.last_generation = min(self.last_generation, (packet.generation or 1) - 1)
    return original(self, packet)


def _opens_for_writing(patch, protection):
    def map_memory(memory, packet):
        with Path("/dev/shm", memory.name).open("r+b") as file:
            check_fits(packet, os.fstat(file.fileno()).st_size)
            return mmap.mmap(file.fileno(), memory.bytes, mmap.MAP_SHARED, protection)

    client.MAPS_MEMORY.replace(patch, map_memory)


@mutant("MEM-19", check=READS, code="opened-for-writing")
def maps_memory_for_writing(patch):
    """Maps the memory for reading and writing, as common libraries do."""
    _opens_for_writing(patch, mmap.PROT_READ | mmap.PROT_WRITE)


@mutant("MEM-19", check=READS, code="opened-for-writing")
def opens_memory_for_writing_and_maps_it_for_reading(patch):
    """Opens the memory for reading and writing, and maps it for reading."""
    _opens_for_writing(patch, mmap.PROT_READ)


@mutant("MEM-19", check=READS, code="not-opened", at=client.MAPS_MEMORY)
def wants_memory_that_its_user_may_write(original, memory, packet):
    """Refuses memory of another mode than 0600."""
    if stat.S_IMODE(Path("/dev/shm", memory.name).stat().st_mode) != 0o600:
        raise OSError("permission denied")
    return original(memory, packet)
