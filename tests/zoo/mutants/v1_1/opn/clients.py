"""Mutants that break OPN: the answers to init packets, and the memory."""

import json
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Any

from splatbus_client.events import Announced, MustClose
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.reading import Reading
from splatbus_wire.init_packet import HostMemory, readable_generation
from splatbus_wire.messages import Closed, Opened, OpenFailed, encode

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.mem.clients import says_opened
from tests.zoo.mutants.v1_1.neg.clients import without

ONCE = "check_answers_each_init_packet_once"
FORMER = "check_closes_the_former_memory"
NEVER_TWICE = "check_answers_no_generation_twice"
ALONE = "check_leaves_the_memory_alone"

KEPT: list[Any] = []
"""What a mutant does not let go."""


@mutant("OPN-1", code="answered-twice", at=client.SAYS_OPENED)
def answers_twice(original, self, packet):
    """Answers `opened` twice."""
    self.unsent += encode(Opened(packet.generation))
    original(self, packet)


@mutant("OPN-13", code="missing-member")
def answers_without_a_generation(patch):
    """Answers `opened` without saying what."""
    messages(patch, of_type("opened", without("generation")))


@mutant("OPN-13", code="missing-member", through="MEM-6")
def declines_without_a_reason(patch):
    """Answers `open_failed` without a reason."""
    messages(patch, of_type("open_failed", without("reason")))


@mutant("OPN-3", code="bad-string", through="MEM-6")
def declines_with_an_empty_reason(patch):
    """Answers `open_failed` with an empty reason."""
    messages(patch, of_type("open_failed", lambda failed: failed | {"reason": ""}))


@mutant("OPN-3", code="bad-string", through="MEM-6")
def declines_at_length(patch):
    """Answers `open_failed` with a reason of 2,000 characters."""
    messages(patch, of_type("open_failed", lambda failed: failed | {"reason": "no " * 667}))


@mutant("OPN-5", code="too-early", through="NEG-4", at=client.SAYS_OPENED)
def closes_before_it_opens(original, self, packet):
    """Says that the old memory is closed before it answers for the new."""
    for generation in self.slots:
        self.unsent += encode(Closed(generation))
    original(self, packet)


@mutant("OPN-13", code="out-of-range")
def counts_generations_from_zero(patch):
    """Answers with a generation that is one too small."""
    _answers_for(patch, -1)


@mutant("OPN-11", code="unknown-generation")
def answers_for_the_next_generation(patch):
    """Answers with a generation that is one too large."""
    _answers_for(patch, 1)


def _answers_for(patch, away):
    messages(patch, of_type("opened", lambda it: it | {"generation": it["generation"] + away}))


@mutant("OPN-11", check=NEVER_TWICE, code="answered-twice", at=client.TAKES_INIT_PACKET)
def declines_what_repeats_a_generation(original, self, packet):
    """Answers `open_failed` to an init packet whose generation is not a new one."""
    if self.version == "1.1" and packet.generation <= self.last_generation:
        self.send(OpenFailed(packet.generation, "that is not a new generation"))
    return original(self, packet)


@mutant("OPN-11", check=NEVER_TWICE, code="answered-twice", at=client.TAKES_BROKEN_PACKET)
def declines_whatever_breaks_a_rule(original, self, payload, problem):
    """Answers `open_failed` to a broken init packet without a look at what it has answered."""
    generation = readable_generation(json.loads(payload)) if self.version == "1.1" else None
    if generation is None or generation > self.last_generation:
        return original(self, payload, problem)
    self.send(OpenFailed(generation, "broken"))
    return iter(())


@mutant("OPN-11", check=NEVER_TWICE, code="answered-twice")
def opens_what_it_could_not_open_at_first(patch):
    """Opens memory of a generation that it has declined, when that is announced again."""
    declined: set[tuple[IpcProtocol, int]] = set()

    def open_failed(original, self, packet, reason):
        declined.add((self, packet.generation))
        original(self, packet, reason)

    def on_init_packet(original, self, packet):
        if (self, packet.generation) in declined:
            self.last_generation = packet.generation - 1
        return original(self, packet)

    client.SAYS_OPEN_FAILED.wrap(patch, open_failed)
    client.TAKES_INIT_PACKET.wrap(patch, on_init_packet)


@mutant("OPN-11", code="not-opened", through="OPN-4", at=client.SAYS_OPEN_FAILED)
def closes_what_it_has_not_opened(original, self, packet, reason):
    """Says `closed` after `open_failed`."""
    original(self, packet, reason)
    if "reinit" in self.capabilities:
        self.send(Closed(packet.generation))


@mutant("OPN-1", check=ONCE, code="no-reply", at=client.TAKES_WELCOME_ON_IPC)
def wants_to_know_who_says_welcome(original, self, welcome):
    """Ignores a `welcome` of a server that has no name, or no version."""
    return original(self, welcome) if all(welcome.server) else iter(())


@mutant("OPN-1", check=ONCE, code="no-reply")
def answers_success_alone(patch):
    """Says nothing when memory cannot be opened."""
    client.SAYS_OPEN_FAILED.replace(patch, lambda *_: None)


@mutant("OPN-1", check=ONCE, code="no-reply", at=client.RECEIVES_ON_IPC)
def answers_the_last_of_several(original, self, data, now):
    """Of several init packets that come at once, opens and answers the last alone."""
    events = list(original(self, data, now))
    announced = [event for event in events if isinstance(event, Announced)]
    return [event for event in events if event not in announced[:-1]]


@mutant("OPN-1", check=ONCE, code="answered-twice", at=client.SAYS_OPEN_FAILED)
def says_opened_after_open_failed(original, self, packet, reason):
    """Answers `opened` after `open_failed`, for the same generation."""
    original(self, packet, reason)
    self.unsent += encode(Opened(packet.generation))


@mutant("OPN-2", check="check_maps_before_it_says_so", code="opened-missing-memory")
def says_opened_of_what_is_not_there(patch):
    """Answers `opened` although there is no such memory."""
    says_opened(patch, "no shared memory")


@mutant(
    "OPN-2",
    check="check_maps_before_it_says_so",
    code="not-mapped",
    at=Seam(Reading, "open_memory"),
)
def maps_when_the_first_frame_comes(original, self, packet):
    """Answers `opened` at once, and maps the memory when it is needed."""
    assert self.machine is not None
    self.machine.opened(packet)


@mutant("OPN-3", check="check_says_why_it_failed", code="wrong-length")
def quotes_what_it_was_sent(patch):
    """Quotes the whole init packet in the reason."""

    def longer(failed):
        return failed | {"reason": failed["reason"] + 2000 * "."}

    messages(patch, of_type("open_failed", longer))


@mutant("OPN-4", check="check_keeps_the_connection_after_failing", code="closes")
def closes_after_failing(patch):
    """Closes the connection after `open_failed`."""
    failed: set[IpcProtocol] = set()

    def open_failed(original, self, packet, reason):
        original(self, packet, reason)
        failed.add(self)

    client.SAYS_OPEN_FAILED.wrap(patch, open_failed)
    client.DEADLINE_ON_IPC.wrap(patch, lambda o, self: 0.0 if self in failed else o(self))
    client.EXPIRES_ON_IPC.wrap(
        patch,
        lambda o, self, now: [MustClose("failed")] if self in failed else o(self, now),
    )


@mutant("OPN-5", check=FORMER, code="not-closed")
def never_says_closed(patch):
    """Unmaps the former memory, and does not say so."""
    client.SAYS_CLOSED.replace(patch, lambda *_: None)


@mutant("OPN-5", check=FORMER, code="not-closed", at=client.SAYS_OPEN_FAILED)
def keeps_what_it_has_if_it_cannot_open_more(original, self, *arguments):
    """Does not say that the former memory is closed where it cannot open the new."""
    original(self, *arguments)
    self.retired.clear()


@mutant("OPN-5", check=FORMER, code="still-mapped")
def says_closed_and_keeps_the_memory(patch):
    """Says that the former memory is closed, and keeps it mapped."""

    def close(self):
        KEPT.append(self.map)
        return True

    client.UNMAPS_MEMORY.replace(patch, close)


@mutant("OPN-5", check=FORMER, code="closed-too-often", at=client.SAYS_CLOSED)
def says_closed_twice(original, self, generation):
    """Says twice that memory is closed."""
    if generation in self.retired:
        self.unsent += encode(Closed(generation))
    original(self, generation)


@mutant(
    "OPN-6",
    check="check_ignores_what_it_was_not_granted",
    code="accepts",
    at=client.TAKES_WELCOME_ON_IPC,
)
def takes_what_was_not_agreed(original, self, welcome):
    """Opens further init packets whether `welcome` lists `reinit` or not."""
    yield from original(self, welcome)
    self.capabilities |= {"reinit"}


@mutant("OPN-6", code="not-ignored", through="OPN-6", at=client.TAKES_INIT_PACKET)
def declines_what_was_not_agreed(original, self, packet):
    """Answers `open_failed` to a further init packet, where `welcome` does not list `reinit`."""
    if self.last_generation and "reinit" not in self.capabilities:
        self.unsent += encode(OpenFailed(packet.generation, "not agreed"))
    return original(self, packet)


@mutant("OPN-10", check=ALONE, code="wrote-to-memory", at=client.BEGINS_WITH_MEMORY)
def writes_to_the_memory(original, self, packet):
    """Marks in the memory that it was here."""
    original(self, packet)
    assert isinstance(packet.memory, HostMemory)
    with Path("/dev/shm", packet.memory.name).open("r+b") as memory:
        memory.write(b"here")


@mutant("OPN-10", check=ALONE, code="removed-memory")
def removes_the_memory(patch):
    """Removes the memory when the connection ends."""
    names: list[str] = []

    def images(original, self, packet):
        original(self, packet)
        assert isinstance(packet.memory, HostMemory)
        names.append(packet.memory.name)

    def end(original, self):
        original(self)
        for name in names:
            Path("/dev/shm", name).unlink(missing_ok=True)

    client.BEGINS_WITH_MEMORY.wrap(patch, images)
    client.ENDS_READING.wrap(patch, end)


@mutant("OPN-10", check=ALONE, code="removed-memory", at=client.BEGINS_WITH_MEMORY)
def tracks_the_memory_as_its_own(original, self, packet):
    """Opens the memory with a library that removes it when the process ends."""
    original(self, packet)
    assert isinstance(packet.memory, HostMemory)
    KEPT.append(SharedMemory(packet.memory.name))
