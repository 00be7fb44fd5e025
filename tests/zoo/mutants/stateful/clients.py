"""Mutants that one scenario does not find: what is wrong follows from what was before."""

from collections import Counter

from splatbus_client.host_memory import CannotOpenError
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.init_packet import InitPacket
from splatbus_wire.messages import Closed, Opened, encode

from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import crash
from tests.zoo.mutant import mutant


def _counted(patch):
    """How many init packets had come on its connection with each, and with the last, None."""
    on_it: Counter[IpcProtocol] = Counter()
    counts: Counter[InitPacket | None] = Counter()

    def on_init_packet(original, self, packet):
        on_it[self] += 1
        counts[packet] = counts[None] = on_it[self]
        return original(self, packet)

    client.TAKES_INIT_PACKET.wrap(patch, on_init_packet)
    return counts


@mutant("CHN-19", check="check_survives_any_session", code="dies")
def crashes_when_lost_without_images(patch):
    """Crashes when the message connection is lost while the memory could not be opened."""
    failed: list[bool] = [False]

    def open_failed(original, *arguments):
        failed[0] = True
        original(*arguments)

    def opened(original, *arguments):
        failed[0] = False
        original(*arguments)

    def lose(original, self, reason, now):
        if failed[0] and isinstance(self.machine, MessageProtocol):
            crash()
        original(self, reason, now)

    client.SAYS_OPEN_FAILED.wrap(patch, open_failed)
    client.SAYS_OPENED.wrap(patch, opened)
    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-20", check="check_returns_in_any_session", code="no-reconnect")
def stays_away_after_a_second_memory(patch):
    """Does not connect to the IPC channel again once memory was announced there twice."""

    counts = _counted(patch)

    def lose(original, self, reason, now):
        lost = self.machine
        original(self, reason, now)
        if isinstance(lost, IpcProtocol) and counts[None] > 1:
            self.due = now + 600

    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant(
    "CHN-24",
    check="check_uses_the_new_memory_in_any_session",
    code="open-failed",
)
def keeps_the_last_size_over_a_loss(patch):
    """Opens only memory of the size before, on the connection after one on which it changed."""
    changed: set[tuple[int, int]] = set()
    counts = _counted(patch)

    def images(original, packet):
        size = packet.width, packet.height
        if counts[packet] == 1 and changed and size not in changed:
            raise CannotOpenError(f"the images are not {changed} any more")
        changed.clear()
        if counts[packet] != 1:
            changed.add(size)
        return original(packet)

    client.OPENS_MEMORY.wrap(patch, images)


@mutant("OPN-1", check="check_answers_in_any_session", code="answered-twice")
def answers_twice_after_a_failure(patch):
    """Answers `opened` twice on the connection after one on which memory could not be opened."""
    failed: list[IpcProtocol] = []

    def open_failed(original, self, *arguments):
        failed.append(self)
        original(self, *arguments)

    def opened(original, self, packet):
        if failed and self not in failed:
            failed.clear()
            self.unsent += encode(Opened(packet.generation or 0))
        original(self, packet)

    client.SAYS_OPEN_FAILED.wrap(patch, open_failed)
    client.SAYS_OPENED.wrap(patch, opened)


@mutant(
    "OPN-5",
    check="check_closes_former_memory_in_any_session",
    code="not-closed",
)
def closes_each_generation_once_in_its_life(patch):
    """Says `closed` of each generation once, over all connections."""
    said: set[int] = set()

    def closed(original, self, generation):
        before = bytes(self.unsent)
        original(self, generation)
        if bytes(self.unsent) != before:
            if generation in said:
                self.unsent[:] = self.unsent.removesuffix(encode(Closed(generation)))
            said.add(generation)

    client.SAYS_CLOSED.wrap(patch, closed)


@mutant(
    "IMG-12",
    check="check_releases_in_any_session",
    code="not-released",
)
def remembers_releases_over_a_loss(patch):
    """Does not release a frame of further memory if it released its like on a connection before."""
    released: set[tuple[int, int]] = set()
    counts = _counted(patch)

    def release(original, self, frame):
        image = frame.generation, frame.seq
        if image not in released:
            original(self, frame)
        if counts[None] > 1:
            released.add(image)

    client.RELEASES.wrap(patch, release)
