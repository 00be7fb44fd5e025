"""The part that the harness plays: a well-behaved server, on whatever a check leaves to it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.rings import TIGHT, Arrangement, arranged
from splatbus_conformance.images.memory.cuda_stand_in.ring import DeviceRing
from splatbus_conformance.images.memory.device import Allocation
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.dealings import Dealings
from splatbus_conformance.trials.viewpoint import Viewpoint, viewpoint
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.json_values import strings, texts, whole, within
from splatbus_conformance.wire.message_kinds import REQUESTS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

MAX_SIZE: int = LIMITS["max_image_size"]
LAST_GENERATION: int = LIMITS["max_safe_integer"]
FIRST_NUMBERS = (0, 1, 1, 1, 2**16 - 1, 2**31 - 1, 2**32 - 1)
PROGRAM = {"name": "splatbus-conformance", "version": "1.1"}
FIRST_GENERATIONS = (2, 77, 2**16 - 1, 2**31 - 1, 2**32 - 1)
"""On every second pair of connections; on the others the least that there is."""
LEAPS = (2, 255, 2**16, 2**32)
STEPS = (1, 1, 1, 1, 1, *LEAPS)
"""From the number of a frame to that of the next, and from generation to generation; the first of
these is a leap.
"""

LENS = {"fx": (0.7, 1.0), "fy": (0.7, 1.0), "cx": (0.3, 0.45), "cy": (0.55, 0.7)}
"""From where to where each number of the lens is drawn, as parts of a side of the image."""


class NextFrame(NamedTuple):
    """What the next frame on a connection will be called, and where it will lie."""

    seq: int
    slot: int


@dataclass
class ServedConnection(Dealings):
    """What was said on one connection, and which memory and images it was about."""

    generations: list[int] = field(default_factory=list)
    """Of each init packet that was sent."""
    opened: set[int] = field(default_factory=set)
    failed: set[int] = field(default_factory=set)
    closed: set[int] = field(default_factory=set)
    released: list[int] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    """`seq` of each frame that was sent."""
    coming: NextFrame | None = None
    slots: list[int] = field(default_factory=list)
    """Those that were not lent yet since all were."""
    drawn: Random = field(default_factory=Random)
    """What numbers and slots are drawn from."""
    seen_through: Json = field(default_factory=dict)
    """The lens that the last frame said: the harness's own, or one that a client steers with."""
    lent_of: int = 0
    """Its generation."""
    shown: Viewpoint | None = None
    """From where the last frame was seen, if a client has put the camera there."""
    telemetry: int = 0
    """`seq` of the last telemetry that was sent."""

    @property
    def generation(self) -> int:
        """Of the last init packet that was sent; 0 if none was."""
        return self.generations[-1] if self.generations else 0

    @property
    def has_opened(self) -> bool:
        """The memory that was offered last was opened."""
        return self.generation in self.opened

    @property
    def is_unanswered(self) -> bool:
        """Memory was offered after `welcome`, and neither opened nor declined yet."""
        last = self.generation
        return bool(self.welcome and last) and last not in self.opened | self.failed

    @property
    def lends(self) -> bool:
        """A frame has been lent, and not been given back, nor its memory (OPN-14)."""
        if not self.frames or self.lent_of in self.closed | self.failed:
            return False
        return self.frames[-1] not in self.released


class ScriptedServer:
    """Answers `hello`, offers memory, lends frames, replies to requests and tells telemetry.

    A check sets the switches before the testee connects, to leave out what it does itself. What a
    client has to read and could guess is drawn: numbers and slots of frames, the lens, and how the
    bytes are cut and joined.
    """

    def __init__(
        self,
        memory: HostMemory,
        width: int,
        height: int,
        slots: int = 3,
        seed: int = 0,
        arrangement: Arrangement = TIGHT,
    ) -> None:
        self._seed = seed
        self._arrangement = arrangement
        self._random = Random(f"role {seed}")
        self.memory: HostMemory | Allocation = memory
        self.ring: DeviceRing | None = None
        """What is offered in place of memory of the host: see `offer_on_device`."""
        self.width, self.height, self.slots = width, height, slots
        self.speaks = "1.1"
        """`1.0` plays a server that knows no `hello`."""
        self.device_packet: Json | None = None
        """What a server of 1.0 offers; without it, handles that no device knows."""
        self.welcomes = True
        self.server = PROGRAM
        """What it calls itself in `welcome`."""
        self.offers_memory = True
        self.lends_frames = True
        """Lends one frame of each generation that is opened, and of each pose with a tag; a check
        lends more itself."""
        self.has_image = True
        """Until then sizes are told as [0,0] (REQ-4), and nothing is lent."""
        self.viewpoint: Viewpoint | None = None
        self.replies = True
        self.gives_sizes = True
        """No size that the testee asked for had to be refused: one that closes over an error would
        close for good."""
        self.spoil: Callable[[Json], Json] = lambda reply: reply
        """Changes replies before they are sent; a check may break them."""
        self.encode: dict[Channel, Callable[[Json], bytes]] = dict.fromkeys(
            CHANNELS, messages.encode
        )
        """Writes the payloads of each channel; a check may spell them otherwise."""
        self.dealings: dict[Connection, ServedConnection] = {}
        self._lens: dict[str, float] = {}
        self.change_lens()

    @property
    def lens(self) -> Json:
        """The lens of the images, whose principal point is not in the middle."""
        sides = {"fx": self.width, "fy": self.width, "cx": self.width, "cy": self.height}
        drawn = {name: part * sides[name] for name, part in self._lens.items()}
        return messages.intrinsics(self.width, self.height) | drawn

    def change_lens(self) -> None:
        """See the images that are lent from now on through another lens."""
        self._lens = {name: self._random.uniform(*of) for name, of in LENS.items()}

    def arrange(self, arrangement: Arrangement) -> None:
        """Have the slots of rings that are offered from now on lie so."""
        self._arrangement = arrangement

    def with_(self, connection: Connection) -> ServedConnection:
        """What was said on this connection; on each, frames have the same numbers and slots."""
        if connection not in self.dealings:
            self.dealings[connection] = ServedConnection(drawn=Random(f"frames {self._seed}"))
        return self.dealings[connection]

    @property
    def greets(self) -> bool:
        """Whether it answers `hello`."""
        return self.welcomes and self.speaks != "1.0"

    def is_given_up(self) -> bool:
        """Whether a client has closed a connection on which it had made a request."""
        left = (d for c, d in self.dealings.items() if c.channel == "msg" and c.open and c.ended)
        return any(dealings.all_of(*REQUESTS) for dealings in left)

    def on_open(self, connection: Connection) -> None:
        """A testee connected."""
        if connection.channel == "ipc" and self.speaks == "1.0" and self.offers_memory:
            self.offer(connection, self.legacy_init_packet())

    def on_message(self, connection: Connection, arrived: Message) -> None:
        """A testee sent a message."""
        if (message := arrived.value) is None:
            return
        dealings = self.with_(connection)
        dealings.heard.append(message)
        if not arrived.finite:  # it could not be repeated
            return
        kind = message.get("type")
        if kind == "hello":
            dealings.hello = message
            self.welcome_whoever_waits(connection)
        elif connection.channel == "msg":
            if self.replies and (dealings.welcome or not dealings.hello or self.speaks == "1.0"):
                self.reply(connection, message)
            self._on_msg(connection, dealings, message)
        else:
            self._on_ipc(connection, dealings, message)

    def welcome_whoever_waits(self, connection: Connection) -> None:
        """Answer a `hello`, also one that came while welcomes were withheld, and are no longer."""
        dealings = self.with_(connection)
        if dealings.hello and not dealings.welcome and self.greets:
            self.welcome(connection)

    def welcome(self, connection: Connection, **changes: object) -> None:
        """Send `welcome`, with members changed as named, and the memory that goes with it."""
        dealings = self.with_(connection)
        offered = texts(within(dealings.hello, "capabilities"))
        dealings.welcome = messages.welcome(connection.channel, offered) | {"server": self.server}
        kind = "cuda_ipc" if self.ring else "host_shm"
        if connection.channel == "ipc" and self.ring:
            others = [it for it in dealings.welcome["capabilities"] if it != "host_shm"]
            dealings.welcome["capabilities"] = [kind, *others] if kind in offered else others
        if not (self.gives_sizes and self._may_resize):
            dealings.welcome["capabilities"] = [
                it for it in dealings.welcome["capabilities"] if it != "viewport"
            ]
        dealings.welcome |= changes
        self.say(connection, dealings.welcome)
        for message in dealings.heard if connection.channel == "msg" and self.replies else ():
            self.reply(connection, message)  # what came meanwhile has waited for it [NEG-6]
        if connection.channel == "ipc" and self.offers_memory and kind in offered:
            self.offer(connection)

    def offer_on_device(self, ring: DeviceRing) -> None:
        """Offer this ring, and write images there, from now on."""
        self.ring, self.memory = ring, ring.memory

    def legacy_init_packet(self) -> Json:
        """A 1.0 init packet: of device memory if there is any, else of this server's size."""
        return self.device_packet or messages.init_packet_1_0(self.width, self.height)

    def next_generation(self, connection: Connection) -> int:
        """The generation of the next init packet of this connection, for who sends it.

        They have gaps, and pass what 16 and 32 bits hold. Two connections have the same, and the
        next two others: who remembers those of a lost connection is found, and who expects them.
        """
        dealings = self.with_(connection)
        begun = sum(bool(it.generations) for it in self.dealings.values() if it is not dealings)
        drawn = Random(f"generations {self._seed} {begun // 2} {len(dealings.generations)}")
        if dealings.generations:
            steps = STEPS if len(dealings.generations) > 1 else LEAPS
            number = min(dealings.generation + drawn.choice(steps), LAST_GENERATION)
        elif (begun // 2 + self._seed) % 2:
            number = drawn.choice(FIRST_GENERATIONS)
        else:
            number = 1
        dealings.generations.append(number)
        return number

    def init_packet(self, connection: Connection) -> Json:
        """A good 1.1 init packet with the next generation of this connection."""
        generation = self.next_generation(connection)
        if self.ring:
            return self.ring.init_packet(generation)
        return self._packet(generation, self.width, self.height)

    def ring_bytes(self, width: int, height: int) -> int:
        """How much memory a ring of images of this size takes."""
        return int(self._packet(0, width, height)["memory"]["bytes"])

    @property
    def ring_layout(self) -> Json:
        """Where the slots lie in what is offered."""
        layout: Json = self.ring.layout if self.ring else self.host_packet["ring"]
        return layout

    @property
    def host_packet(self) -> Json:
        """An init packet of the memory of the host that is offered; no generation is 0 [MEM-1]."""
        return self._packet(0, self.width, self.height)

    def _packet(self, generation: int, width: int, height: int) -> Json:
        name = self.memory.name
        told = messages.init_packet_1_1(name, generation, width, height, self.slots)
        return arranged(told, self._arrangement)

    def offer(self, connection: Connection, init_packet: Json | None = None) -> None:
        """Send an init packet, a good one if no other is given."""
        self.say(connection, init_packet or self.init_packet(connection))

    def coming(self, connection: Connection) -> NextFrame:
        """What is lent next on this connection; of so many frames as there are slots, one in each.

        Numbers have gaps, and pass what 16 and 32 bits hold.
        """
        dealings = self.with_(connection)
        if dealings.coming is None:
            drawn = dealings.drawn
            dealings.slots = dealings.slots or drawn.sample(range(self.slots), self.slots)
            step, first = drawn.choice(STEPS), drawn.choice(FIRST_NUMBERS)
            seq = dealings.frames[-1] + step if dealings.frames else first
            dealings.coming = NextFrame(seq, dealings.slots.pop())
        return dealings.coming

    def lend(self, connection: Connection, **changes: object) -> int:
        """Send a `frame`, with members changed as named; its `seq`."""
        self.say(connection, self.next_frame(connection) | changes)
        return self.with_(connection).frames[-1]

    def next_frame(self, connection: Connection) -> Json:
        """The `frame` that lends the next image, for who sends it."""
        dealings = self.with_(connection)
        seq, slot = self.coming(connection)
        dealings.coming, dealings.lent_of = None, dealings.generation
        dealings.frames.append(seq)
        objects = messages.LISTED[seq % len(messages.LISTED)]
        frame = messages.frame(dealings.generation, seq, slot, self.width, self.height, objects)
        frame["camera"] |= self.lens
        if self.viewpoint:
            frame["camera"] |= self.viewpoint.camera(self.width, self.height)
        dealings.seen_through = {name: frame["camera"][name] for name in self.lens}
        if self.viewpoint and self.viewpoint.tag and self.viewpoint is not dealings.shown:
            frame["camera"]["tag"] = self.viewpoint.tag
        dealings.shown = self.viewpoint
        return frame

    def answer(self, connection: Connection, request: Json) -> Json | None:
        """The reply to a request, or an `error`; None if it is no request on this connection."""
        dealings = self.with_(connection)
        typed = dealings.welcome is not None
        if typed and request.get("type") == "set_viewport" and (code := self._resize(request)):
            self.gives_sizes = False
            return messages.error(code, **{"id": request["id"]} if "id" in request else {})
        lens = "intrinsics" in dealings.granted
        width, height = (self.width, self.height) if self.has_image else (0, 0)
        reply = messages.reply(request, typed=typed, width=width, height=height, lens=lens)
        if reply and "intrinsics" in reply:
            reply["intrinsics"] = self.lens
        if reply and "timeRange" in reply and connection.number % 2:
            reply["timeRange"] = [reply["timeRange"][1]] * 2
        return reply and self.spoil(reply)

    def tell(self, connection: Connection, *more: Json) -> None:
        """Send a `telemetry` of what was subscribed to, in series of all kinds, and of more."""
        dealings = self.with_(connection)
        wishes = dealings.all_of("subscribe_telemetry")
        names = strings(wishes[-1].get("names")) if wishes else None
        dealings.telemetry += 1
        message = messages.telemetry(dealings.telemetry, messages.NAMES if names is None else names)
        message["series"] += more
        if message["series"]:
            self.say(connection, message)

    def reply(self, connection: Connection, message: Json) -> None:
        """Answer what the testee said, if it is a request."""
        if answer := self.answer(connection, message):
            self.say(connection, answer)

    def say(self, connection: Connection, message: Json) -> None:
        """Send a message."""
        connection.send(packet(self.encode[connection.channel](message)))

    @property
    def _may_resize(self) -> bool:
        """Elsewhere a check decides on sizes."""
        return self.ring is None and self.offers_memory and self.lends_frames

    def _resize(self, request: Json) -> str | None:
        """Have images of another size; the code of an `error` if that cannot be."""
        width, height = (whole(request.get(side), 1, MAX_SIZE) for side in ("width", "height"))
        readers = {
            c: d for c, d in self.dealings.items() if c.open and not c.ended and d.generation
        }
        if width is None or height is None:
            return "invalid_message"
        fits = self.ring_bytes(width, height) <= self.memory.size
        if not (fits and self._may_resize):
            return "unsupported"
        if any("reinit" not in dealings.granted for dealings in readers.values()):
            return "unsupported"
        if any(set(d.generations[:-1]) - d.closed - d.failed for d in readers.values()):
            return "busy"
        self.has_image = True
        if (width, height) != (self.width, self.height):
            self.width, self.height = width, height
            for connection in readers:
                self.offer(connection)
        return None

    def _on_msg(self, connection: Connection, dealings: ServedConnection, message: Json) -> None:
        kind, granted = message.get("type"), dealings.granted
        if kind == "camera_pose" and dealings.welcome is not None:
            before = self.viewpoint
            self.viewpoint = viewpoint(message, before, lens="intrinsics" in granted)
            if self.viewpoint is not before:
                for reader in list(self.dealings):
                    self._show(reader)
        elif kind == "subscribe_telemetry" and "telemetry" in granted:
            self.tell(connection)

    def _show(self, reader: Connection) -> None:
        """Lend a frame of new memory or from a new viewpoint, once the last has come back."""
        dealings = self.with_(reader)
        may = self.lends_frames and self.has_image and "frames" in dealings.granted
        opened = reader.open and dealings.generation in dealings.opened - dealings.closed
        new = dealings.lent_of < dealings.generation or self.viewpoint is not dealings.shown
        if may and opened and new and not dealings.lends:
            self.lend(reader)

    def _on_ipc(self, connection: Connection, dealings: ServedConnection, message: Json) -> None:
        generation = whole(message.get("generation"))
        if generation is None:
            return
        kind = message.get("type")
        if kind == "opened":
            dealings.opened.add(generation)
        elif kind == "open_failed":
            dealings.failed.add(generation)
        elif kind == "closed":
            dealings.closed.add(generation)
        elif kind == "release" and (seq := whole(message.get("seq"))) is not None:
            dealings.released.append(seq)
        self._show(connection)
