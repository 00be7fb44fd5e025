"""Images lent to a client, in a ring whose other slots hold what nobody may read."""

from splatbus_conformance.images import painted
from splatbus_conformance.images.painted import Painting, spoilt
from splatbus_conformance.trials import memory_pace
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.scripted_server import NextFrame
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

GLANCE_SECONDS = 0.02


def reading(trial: ClientTrial) -> Connection:
    """An IPC connection on which the testee has opened the memory and reads frames."""
    trial.role.lends_frames = False
    connection = trial.greeted("ipc")
    if not trial.opens(connection):
        trial.not_observable("the testee did not open the memory")
    return connection


class FrameLender:
    """Paints a slot, lends it, and spoils it in the moment in which it is given back.

    Attributes:
        connection: the IPC connection on which the testee reads.
        shown: the image of each number that was lent.
    """

    def __init__(self, trial: ClientTrial, connection: Connection | None = None) -> None:
        self.shown: dict[int, Painting] = {}
        self._slots: dict[int, int] = {}
        self._trial, self._role = trial, trial.role
        self.spoil_everything()
        self.connection = connection or reading(trial)
        self._former = trial.peer.on_message
        trial.peer.on_message = self._on_message

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self._role.width, self._role.height

    @property
    def lens(self) -> Json:
        """What the last image was said to be seen through, which a client may have decided."""
        return self._role.with_(self.connection).seen_through

    def lend(self, image: Painting) -> int:
        """Lend an image once none is lent, and do not wait until it has been read; its number."""
        _, slot = self.announced(image)
        self.paint(image, slot)
        return self._trial.lend(self.connection)

    def announced(self, image: Painting) -> NextFrame:
        """Know an image as the one to be lent next; its number and its slot."""
        coming = self._role.coming(self.connection)
        self.shown[coming.seq], self._slots[coming.seq] = image, coming.slot
        return coming

    def show(self, image: Painting) -> int:
        """Lend an image, and wait until the client has read it; its number.

        Skips the check if it never does.
        """
        seq = self.lend(image)
        if not self._trial.releases(self.connection, seq):
            self._trial.not_observable("the testee did not give an image back")
        if self.newest()["seq"] != seq:
            self._trial.not_observable("the newest image of the client is not the one it gave back")
        return seq

    def newest(self) -> Json:
        """The client's digest of its newest image: the last that was lent, if it comes in time."""
        trial, last = self._trial, max(self.shown, default=None)
        answer = trial.ask("digest")
        clock = trial.peer.clock
        deadline = clock() + memory_pace.patience(trial.facts.memory_seconds)
        while answer["seq"] != last and clock() < deadline:
            trial.rest(GLANCE_SECONDS)
            answer = trial.ask("digest")
        return answer

    def paint(self, image: Painting, slot: int) -> None:
        """Write an image to a slot, whether or not it is lent."""
        painted.write(self._role.memory, image, slot, self._role.ring_layout)

    def spoil_everything(self) -> None:
        """Write over every slot."""
        for slot in range(self._role.slots):
            self.paint(spoilt(*self.size), slot)

    def _on_message(self, connection: Connection, arrived: Message) -> None:
        released = self._role.with_(connection).released
        before = len(released)
        self._former(connection, arrived)
        for seq in self.shown.keys() & released[before:]:
            self.paint(spoilt(*self.size), self._slots[seq])
