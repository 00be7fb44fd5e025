"""Mutants that break CHN: the life of the two channels."""

import time

from splatbus_client import ipc_protocol, message_protocol
from splatbus_client.channel import Channel
from splatbus_client.events import MustClose
from splatbus_client.host_memory import CannotOpenError
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_wire import settings
from splatbus_wire.messages import GetViewportSize, Hello, encode

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import crash
from tests.zoo.mutant import mutant


def all_channels(patch):
    """The channels of the client, once it has made them."""
    made: list[Channel] = []

    def init(original, self, *arguments):
        original(self, *arguments)
        made.append(self)

    Seam(Channel, "__init__").wrap(patch, init)
    return made


@mutant("CHN-2", check="check_host_and_ports_can_be_set", code="another-port")
def ipc_port_that_cannot_be_set(patch):
    """Connects to the IPC channel on port 6001, whatever it is told."""
    Seam(settings.Settings, "__new__").wrap(
        patch,
        lambda original, cls, host, ipc, msg, token: original(cls, host, 6001, msg, token),
    )


@mutant("CHN-3", check="check_either_channel_first", code="hangs")
def gives_up_what_refused_when_the_other_accepts(patch):
    """Does not try the IPC channel any more that refused while the message channel accepted."""
    made = all_channels(patch)

    def lose(original, self, reason, now):
        refused = self.machine is None
        original(self, reason, now)
        if refused and self is made[0] and made[1].machine is not None:
            self.due = now + 600

    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-3", check="check_either_channel_first", code="hangs")
def gives_up_what_is_accepted_late(patch):
    """Leaves the IPC channel for ever if it says nothing within 0.3 seconds."""
    given_up: list[float] = []

    def limit(self):
        since: float = vars(self).setdefault("since", time.monotonic())
        return since + 0.3 if self.version is None else float("inf")

    def deadline(original, self):
        return min(limit(self), original(self) or float("inf"))

    def expire(original, self, now):
        if now < limit(self):
            return original(self, now)
        given_up.append(now)
        return [MustClose("a limit of the mutant")]

    def connect(original, self, now):
        if given_up and self.name == "IPC":
            self.due = now + 600
        else:
            original(self, now)

    client.DEADLINE_ON_IPC.wrap(patch, deadline)
    client.EXPIRES_ON_IPC.wrap(patch, expire)
    client.CONNECTS.wrap(patch, connect)


@mutant("CHN-9", check="check_waits_for_the_init_packet", code="closes")
def impatient_for_the_init_packet(patch):
    """Closes the IPC connection if no init packet has come within five seconds."""
    _limit(patch, lambda machine: not machine.slots, 5.0)


@mutant("CHN-9", check="check_waits_for_the_init_packet", code="hangs")
def deaf_to_a_late_init_packet(patch):
    """Ignores the first init packet if it comes later than a second after the connection."""
    begun: dict[IpcProtocol, float] = {}

    def init(original, self, *arguments):
        original(self, *arguments)
        begun[self] = time.monotonic()

    def take(original, self, packet):
        if self.slots or time.monotonic() < begun[self] + 1.0:
            yield from original(self, packet)

    client.BEGINS_ON_IPC.wrap(patch, init)
    client.TAKES_INIT_PACKET.wrap(patch, take)


@mutant("CHN-10", check="check_keeps_the_ipc_connection", code="closes")
def ipc_connection_closed_once_opened(patch):
    """Closes the IPC connection when it has what it wants, and goes on reading."""
    _limit(patch, lambda machine: bool(machine.slots), 0.2)


def _limit(patch, applies, seconds):
    """Close an IPC connection when something has applied for so long."""
    since: dict[IpcProtocol, float] = {}

    def deadline(original, self):
        if applies(self):
            return since.setdefault(self, time.monotonic()) + seconds
        given: float | None = original(self)
        return given

    def expire(original, self, now):
        if applies(self) and now >= since.setdefault(self, now) + seconds:
            return [MustClose("a limit of the mutant")]
        return original(self, now)

    client.DEADLINE_ON_IPC.wrap(patch, deadline)
    client.EXPIRES_ON_IPC.wrap(patch, expire)


@mutant("CHN-15", check="check_gives_up_a_reply", code="hangs")
def waits_for_a_reply_for_ever(patch):
    """Never gives up waiting for a reply."""
    Seam(message_protocol, "REPLY_SECONDS").replace(patch, 600.0)


@mutant(
    "CHN-17", check="check_closes_after_end_of_stream", code="hangs", at=client.LOSES_CONNECTION
)
def deaf_to_the_end_of_the_stream(original, self, reason, now):
    """Keeps its side open when the server has ended the stream."""
    if reason == "the server ended it":
        time.sleep(0.02)  # it will be said again at once
    else:
        original(self, reason, now)


@mutant(
    "CHN-17", check="check_closes_after_end_of_stream", code="hangs", at=client.LOSES_CONNECTION
)
def waits_for_a_reply_after_the_end_of_the_stream(original, self, reason, now):
    """Keeps its side open when the server has ended the stream and still owes it a reply."""
    if reason == "the server ended it" and getattr(self.machine, "asked", None) is not None:
        time.sleep(0.02)
    else:
        original(self, reason, now)


@mutant("CHN-17", check="check_closes_after_end_of_stream", code="dies", at=client.LOSES_CONNECTION)
def crashes_at_the_end_of_the_stream(original, self, reason, now):
    """Crashes when the server ends the stream."""
    if reason == "the server ended it":
        crash()
    original(self, reason, now)


@mutant("CHN-19", check="check_survives_losing_its_server", code="dies", at=client.LOSES_CONNECTION)
def crashes_when_reset(original, self, reason, now):
    """Crashes when a connection is reset."""
    if "reset" in reason:
        crash()
    original(self, reason, now)


@mutant(
    "CHN-19", check="check_survives_losing_its_server", code="hangs", at=client.LOSES_CONNECTION
)
def hangs_when_reset(original, self, reason, now):
    """Hangs when a connection is reset."""
    while "reset" in reason:
        time.sleep(60)
    original(self, reason, now)


@mutant("CHN-20", check="check_connects_again", code="waits")
def never_connects_to_ipc_again(patch):
    """Does not connect to the IPC channel again."""
    made = all_channels(patch)

    def lose(original, self, reason, now):
        original(self, reason, now)
        if self is made[0] and self.status.connections:
            self.due = now + 600

    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-23", check="check_keeps_the_other_channel", code="closes")
def drops_both_channels(patch):
    """Closes both connections when one is lost."""
    made = all_channels(patch)

    def lose(original, self, reason, now):
        original(self, reason, now)
        for other in made:
            if other.machine is not None:
                original(other, reason, now)

    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-23", check="check_keeps_the_other_channel", code="closes")
def drops_both_channels_when_one_is_reset(patch):
    """Closes both connections when one is reset."""
    made = all_channels(patch)

    def lose(original, self, reason, now):
        original(self, reason, now)
        for other in made:
            if other.machine is not None and "reset" in reason:
                original(other, reason, now)

    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-24", check="check_uses_the_new_memory", code="not-opened")
def insists_on_the_first_size(patch):
    """Opens no memory of another size than the first that it saw."""
    _insists(patch, lambda reason: False)


@mutant("CHN-24", check="check_uses_the_new_memory", code="not-opened")
def insists_on_the_former_size_when_it_was_reset(patch):
    """Forgets the size of the images when its connection is closed, but not when it is reset."""
    _insists(patch, lambda reason: "reset" not in reason)


def _insists(patch, forgets):
    seen: list[tuple[int, int]] = []

    def images(original, packet):
        seen.append((packet.width, packet.height))
        if seen[-1] != seen[0]:
            raise CannotOpenError(f"the images are not {seen[0]} any more")
        return original(packet)

    def lose(original, self, reason, now):
        if forgets(reason):
            seen.clear()
        original(self, reason, now)

    client.OPENS_MEMORY.wrap(patch, images)
    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-6", code="sent-without-hello", through="CHN-9")
def asks_on_the_ipc_channel_in_1_0(patch):
    """Speaks 1.0, and asks for the size on the IPC channel."""
    speaks_1_0(patch)

    def init(original, self, *arguments):
        original(self, *arguments)
        self.unsent += encode(GetViewportSize())

    client.BEGINS_ON_IPC.wrap(patch, init)


def speaks_1_0(patch):
    """Say no hello on either channel."""

    def silent(original, message, **how):
        return b"" if isinstance(message, Hello) else original(message, **how)

    for module in (ipc_protocol, message_protocol):
        Seam(module, "encode").wrap(patch, silent)
