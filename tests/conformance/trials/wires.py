"""A connection of a scripted part without sockets."""

from splatbus_conformance.trials.scripted_client import ScriptedClient
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.wire.conversation import Assembler, Message
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry, Event

from tests.conformance.rules.talk import Json, about_generation, text


class Wire:
    """What its part says on it, and what it is made to hear; a recording may hold several."""

    def __init__(
        self, part: ScriptedServer | ScriptedClient, channel: Channel, recording: list[Entry]
    ) -> None:
        self.channel, self.open, self.ended = channel, True, None
        self.number = 1 + sum(it.event == "open" for it in recording)
        self.part, self.recording = part, recording
        self.ours: Direction = "s2c" if isinstance(part, ScriptedServer) else "c2s"
        self.said: list[Json] = []
        self._assembler = Assembler()
        self._note(event="open")
        part.on_open(self)

    def send(self, data: bytes) -> None:
        """Take what the part says."""
        self.said += [message.value or {} for message in self._note(self.ours, data)]

    def hear(self, *messages: Json | bytes) -> list[Json]:
        """What the part says to messages that arrive together."""
        data, before = b"".join(packet(text(message)) for message in messages), len(self.said)
        for message in self._note("c2s" if self.ours == "s2c" else "s2c", data):
            self.part.on_message(self, message)
        return self.said[before:]

    def give_back(self) -> list[Json]:
        """What a server says to the release of the frame that it lent last."""
        frame = next(it for it in reversed(self.said) if it.get("type") == "frame")
        return self.hear(about_generation("release", frame["generation"], seq=frame["seq"]))

    def _note(
        self,
        direction: Direction | None = None,
        data: bytes | None = None,
        event: Event | None = None,
    ) -> list[Message]:
        now = 1.0 + 0.01 * len(self.recording)
        self.recording.append(Entry(now, self.channel, self.number, direction, data, event))
        return self._assembler.feed(self.recording[-1])[1]
