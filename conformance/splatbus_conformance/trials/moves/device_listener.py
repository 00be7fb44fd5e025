"""Whether a client still listens on the IPC channel, by the good device memory that it opens.

What is broken comes first on its connection, since some clients read no other packet there.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, PlaneOffsets
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.shown_image import image_of
from splatbus_conformance.trials.trial import (
    ENDING_SECONDS,
    GLANCE_SECONDS,
    REACTION_SECONDS,
    Trial,
)
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

DEVICE = ("stand-in", "ipc")
"""What a check needs that is tried there."""


class DeviceListener:
    """A server of 1.0 that sends what a check wants, and good init packets.

    Each good packet names memory of its own, so that it is seen which of them was opened.
    """

    def __init__(self, trial: ClientTrial, held: ExitStack) -> None:
        self._trial, self._held = trial, held
        held.callback(setattr, trial.role, "speaks", trial.role.speaks)
        trial.role.speaks, trial.role.offers_memory = "1.0", False
        self._further: Connection | None = None
        """A connection on which an image was opened, of a testee that opens more than one there."""
        self._opens_more: bool | None = None
        """Whether it does; None until that was tried."""
        first = self.image()
        if not self.opens(self.fresh(), first):
            trial.not_observable("the testee did not open good device memory")
        self._reads = trial.uses(lambda: first.copies(trial.calls()))
        """It was seen to copy what it opened."""

    def image(
        self, width: int = 64, height: int = 48, layout: PlaneOffsets | None = None
    ) -> DeviceImage:
        """An image in device memory, drawn and complete; freed in the end."""
        return self._held.enter_context(image_of(self._trial, width, height, layout))

    def fresh(self) -> Connection:
        """A new connection on which nothing has been sent."""
        self._further = None
        return self._trial.connection("ipc")

    def opens(
        self,
        connection: Connection,
        image: DeviceImage,
        payload: bytes = b"",
        *,
        behind: bytes = b"",
    ) -> bool:
        """Whether the testee opens an image whose packet is sent here, spelled so if so it is,
        and in one write behind others.
        """
        connection.send(behind + packet(payload or encode(image.init_packet())))
        return self.comes_to_open(connection, image)

    def takes(self, connection: Connection, image: DeviceImage, payload: bytes) -> bool:
        """As `opens`; and it reads it, if it reads at all: some die between the two."""
        trial = self._trial
        if not (self.opens(connection, image, payload) and self._reads):
            return image.opened(trial.calls())
        trial.uses(lambda: image.copies(trial.calls()) or connection.ended)
        return bool(image.copies(trial.calls()))

    def comes_to_open(self, connection: Connection, image: DeviceImage) -> bool:
        """Whether the testee opens an image whose packet was sent."""
        trial = self._trial
        trial.uses(lambda: image.opened(trial.calls()) or connection.ended)
        return image.opened(trial.calls())

    def outcome_before(self, script: bytes) -> str:
        """Send bytes and a good packet in one write, on a new connection: `ignores` (and the good
        one was opened there), `closes`, `exits`, `dies` or `hangs`.
        """
        connection = self.fresh()
        if self.opens(connection, self.image(), behind=script):
            return "ignores"
        # A parser that has gone too deep may take its time to end.
        self._trial.ends(connection, self._trial.patience)
        self._trial.wait(self._trial.fate, ENDING_SECONDS)
        return self._trial.fate() or ("closes" if connection.ended else "hangs")

    def outcome_of(self, script: bytes, *, later: bool = False) -> str:
        """Send bytes first on a new connection, then a good packet there, or on the next.

        Returns `ignores` or `closes` (and the good one was opened), `exits`, `dies` or `hangs`. Of
        a testee that does not return it shows that it listens if it notices the end of its stream;
        nothing if it does not.

        Args:
            script: what is sent.
            later: on a connection on which it has opened another image, if it opens more there.
        """
        trial, good = self._trial, self.image()
        at_first = self._further is None or self._further.ended is not None or not later
        connection = self.fresh() if at_first else self._further
        assert connection is not None
        connection.send(script)
        if not trial.ends(connection, GLANCE_SECONDS):
            connection.send(packet(encode(good.init_packet())))
            seen = trial.wait(
                lambda: good.opened(trial.calls()) or connection.ended, REACTION_SECONDS
            )
            if seen and not connection.ended:
                self._try_for_more(connection)
                return "ignores"
        outcome = "closes" if connection.ended else "ignores"
        if "ipc" not in trial.facts.returns:
            connection.end_stream()
            noticed = trial.ends(connection)
            trial.wait(trial.fate, REACTION_SECONDS)
            return (trial.fate() or outcome) if noticed else self._died()
        connection.close()
        again = trial.next_connection("ipc")
        if again is None or not self.opens(again, good):
            return trial.fate() or "hangs"
        return outcome

    def _try_for_more(self, connection: Connection) -> None:
        """Whoever opens one image a connection looks at no later packet, whatever it holds."""
        if self._opens_more is None:
            another = self.image()
            connection.send(packet(encode(another.init_packet())))
            self._opens_more = self._trial.uses(lambda: another.opened(self._trial.calls()))
        self._further = connection if self._opens_more else None

    def _died(self) -> str:
        return "dies" if self._trial.fate() == "dies" else ""


@contextmanager
def listening(trial: Trial, place: str) -> Iterator[DeviceListener | None]:
    """What a check has in hand where images are in device memory; nothing elsewhere."""
    with ExitStack() as held:
        if isinstance(trial, ClientTrial) and place == "device":
            yield DeviceListener(trial, held)
        else:
            yield None
