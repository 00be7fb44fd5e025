"""Good memory that a check offers in a broken packet: whether the testee opens it all the same."""

import itertools
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager

from splatbus_conformance.cases.malformed.handles import UNKNOWN_HANDLE
from splatbus_conformance.cases.malformed.init_packets import ROOM, BrokenInitPacket, changed
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.device_listener import DeviceListener
from splatbus_conformance.trials.moves.exchanges.exchange import judge_if_seen
from splatbus_conformance.trials.moves.exchanges.unheard import (
    outcome_at_the_end,
    silent_connection,
)
from splatbus_conformance.trials.moves.memory_offers import announce
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.messages import Json, encode, init_packet_1_0
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

NOTHING = BrokenInitPacket("", {})
FIRST_EVERY = 40
BAIT_SIZE = 256, 192
"""Device memory of it has room for every image of a broken packet."""


class Bait:
    """Of a testee that says nothing on the IPC channel: nobody sees whether it opens anything."""

    def __init__(self, trial: ClientTrial, held: ExitStack) -> None:
        self._trial, self._numbers = trial, itertools.count()

    def packet(self, broken: BrokenInitPacket = NOTHING) -> Json:
        """The init packet for it, broken so."""
        return changed(init_packet_1_0(broken.width, broken.height), broken.changes)

    def outcome(self, payload: bytes) -> str:
        """What becomes of this, as `ClientTrial.outcome_on_ipc` has it; nothing where it shows
        nothing.
        """
        return self.outcome_before(packet(payload))

    def outcome_before(self, script: bytes) -> str:
        """What becomes of a good packet behind this; as `outcome`."""
        connection = silent_connection(self._trial)
        connection.send(script)
        if self._trial.ends(connection, REACTION_SECONDS):
            return self._trial.fate() or "closes"
        outcome = outcome_at_the_end(self._trial, connection)
        return "ignores" if outcome == "lives" else outcome

    def unusable(self) -> Mapping[str, Json]:
        """What there is no memory for, as changes of its packet."""
        return {}


class HostBait(Bait):
    """Memory of the host, for a testee of 1.1."""

    def __init__(self, trial: ClientTrial, held: ExitStack) -> None:
        super().__init__(trial, held)
        trial.role.offers_memory = False
        self._memory = held.enter_context(HostMemory(ROOM))
        self._connection: Connection | None = None

    def packet(self, broken: BrokenInitPacket = NOTHING) -> Json:
        """The init packet for it, for the connection where the next payload goes."""
        self._connection = self._next()
        generation = self._trial.role.init_packet(self._connection)["generation"]
        return broken.packet(self._memory.name, generation)

    def outcome_before(self, script: bytes) -> str:
        """What becomes of a good packet behind this on that connection."""
        connection, self._connection = self._connection, None
        return self._trial.outcome_on_ipc(connection or self._next(), script)

    def _next(self) -> Connection:
        return for_broken_packet(self._trial, next(self._numbers))

    def unusable(self) -> Mapping[str, Json]:
        """Names of memory that there is not."""
        with HostMemory(ROOM) as memory:
            gone = memory.name
        names = {"is gone": gone, "never was": "splatbus-check-never-was"}
        return {f"memory that {what}": {"memory/name": name} for what, name in names.items()}


class DeviceBait(Bait):
    """Device memory, for a testee that is seen to open it."""

    def __init__(self, trial: ClientTrial, held: ExitStack) -> None:
        super().__init__(trial, held)
        self.listener = DeviceListener(trial, held)
        self._image = self.listener.image(*BAIT_SIZE)
        named = self._image.init_packet()
        self.handles = {key: text for key, text in named.items() if key != "meta"}

    def packet(self, broken: BrokenInitPacket = NOTHING) -> Json:
        """The init packet of 1.0 with its handles."""
        return changed(init_packet_1_0(broken.width, broken.height) | self.handles, broken.changes)

    def outcome(self, payload: bytes) -> str:
        """The same; every second goes where an image was opened, if the testee opens more there."""
        later = next(self._numbers) % 2 == 1
        return self._unless_opened(self.listener.outcome_of(packet(payload), later=later))

    def outcome_before(self, script: bytes) -> str:
        """What becomes of a good packet in one write with this."""
        return self._unless_opened(self.listener.outcome_before(script))

    def _unless_opened(self, outcome: str) -> str:
        return "accepts" if self._image.opened(self._trial.calls()) else outcome

    def unusable(self) -> Mapping[str, Json]:
        """Whole packets of handles that cannot be opened."""
        gone, good = self.listener.image(), self.listener.image().init_packet()
        freed = gone.init_packet()
        gone.free()
        members = ("mem_color", "mem_depth", "evt_done")
        unknown = {f"an unknown {it}": changed(good, {it: UNKNOWN_HANDLE}) for it in members}
        elsewhere = changed(good, {"meta/device": 99})
        return {"memory that was freed": freed, "device 99": elsewhere, **unknown}


@contextmanager
def baited(trial: ClientTrial, place: str) -> Iterator[Bait]:
    """The bait for this place, held as long as the check goes on."""
    heard = HostBait if trial.facts.speaks_1_1("ipc") else Bait
    with ExitStack() as held:
        yield (DeviceBait if place == "device" else heard)(trial, held)


def judge_breach(
    trial: ClientTrial, bait: Bait, breach: BrokenInitPacket, kinder: Mapping[str, str]
) -> bool:
    """Judge what becomes of bait in a packet that breaks a rule; whether that was seen.

    `kinder` renames outcomes that satisfy the sentence under a name of another version.
    """
    outcome = bait.outcome(encode(bait.packet(breach)))
    what = f"an init packet with {breach.what} ({breach.requirement})"
    return judge_if_seen(trial, kinder.get(outcome, outcome), what)


def judge_breaches(
    trial: ClientTrial, breaches: Iterable[BrokenInitPacket], kinder: Mapping[str, str]
) -> None:
    """The same, by memory of the host, for packets that break a rule each."""
    with baited(trial, "host") as bait:
        for breach in trial.each(breaches, kind=lambda breach: breach.kind):
            judge_breach(trial, bait, breach, kinder)


def for_broken_packet(trial: ClientTrial, number: int) -> Connection:
    """Where a broken packet goes: some are the first on their connection, by the seed.

    Few, since connections are what a testee may not afford.
    """
    first = number < 3 * FIRST_EVERY and number % FIRST_EVERY == trial.seed % FIRST_EVERY
    return trial.greeted("ipc") if first else trial.for_init_packet()


def offer(trial: ClientTrial, init_packet: Json) -> tuple[bool, int]:
    """Offer memory in an init packet, its generation aside; whether it was opened, and which."""
    connection = trial.for_init_packet()
    generation = announce(trial, connection, init_packet)
    return trial.opens(connection), generation
