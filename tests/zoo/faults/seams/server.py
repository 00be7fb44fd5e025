"""The server: its connections, who has control, and the images that it lends."""

from splatbus_server import (
    api,
    connection,
    exchange,
    memory,
    settings,
    shared_memory,
    steering,
    viewport,
)
from splatbus_server.connection import Connection
from splatbus_server.control import Control, Poses
from splatbus_server.exchange import Exchange
from splatbus_server.limits import Limits
from splatbus_server.memory import Memory
from splatbus_server.reader import Reader
from splatbus_server.ring import Ring
from splatbus_server.service import Service
from splatbus_server.session import Session
from splatbus_server.telemetry import Readings
from splatbus_server.viewport import Viewport

from tests.zoo.faults.seam import Seam

# One connection: bytes in, events and bytes out

BEGINS_CONNECTION = Seam(Connection, "__init__")
RECEIVES = Seam(Connection, "receive")
NEXT_EVENT = Seam(Connection, "next_event")
UNDERSTANDS = Seam(Connection, "understand")
ASKS_WHAT_WAS_AGREED = Seam(Connection, "has")
DECODES = Seam(connection, "decode_from_client")
GREETS = Seam(Connection, "greet")
HEARS_CLIENT = Seam(Connection, "is_heard")
ANSWERS_HELLO = Seam(connection, "answer_hello")
REFUSES_PACKET = Seam(Connection, "refuse_packet")
HOLDS_REQUESTS = Seam(Connection, "hold")
COMPLAINS = Seam(Connection, "complain")
SENDS = Seam(Connection, "send")
COUNTS_SENT = Seam(Connection, "sent")
GOES_ON = Seam(Connection, "go_on")
ENDS_CONNECTION = Seam(Connection, "end")

# The sockets of all

LISTENS = Seam(api, "listen")
IS_LOOPBACK = Seam(settings, "is_loopback")
MOST_CONNECTIONS = Seam(Limits, "connections")
ACCEPTS_CLIENT = Seam(Service, "accept")
TAKES_BYTES = Seam(Service, "take")
FLUSHES = Seam(Service, "flush")
DROPS_CLIENT = Seam(Service, "drop")

# What messages do

CAPABILITIES_ON_IPC = Seam(api, "CAPABILITIES")
CAPABILITIES_OF_MESSAGES = Seam(api, "MESSAGE_CAPABILITIES")
HANDLES_MESSAGE = Seam(Session, "handle")
GREETS_CLIENT = Seam(Session, "greet")
ANSWERS_REQUEST = Seam(Session, "answer")
ANNOUNCES_MEMORY = Seam(Session, "announce")
HEARS_OF_MEMORY = Seam(Session, "take_answer")
LENDS_IMAGE = Seam(Session, "lend")
TAKES_IMAGE_BACK = Seam(Session, "release")
TAKES_SUBSCRIPTION = Seam(Session, "subscribe")
TAKES_TELEMETRY_SUBSCRIPTION = Seam(Readings, "subscribe")
TAKES_POSE = Seam(Session, "move")
FORGETS_CLIENT = Seam(Session, "leave")
ENDS_WHO_KEEPS = Seam(Session, "end_who_keeps")
FREES_FORMER_MEMORY = Seam(Session, "free_replaced")
HINDERS_OTHER_SIZE = Seam(Session, "hindrance")
BEGINS_OTHER_SIZE = Seam(Viewport, "set")
SIZE_IN_REPLY = Seam(viewport, "ViewportSize")
JUDGES_SHAPE_OF_LENS = Seam(steering, "fits")

# Who steers

OBEYS = Seam(Control, "move")
PASSES_CONTROL_ON = Seam(Control, "leave")
APPLIES_POSE = Seam(Poses, "moved_by")

# Images on their way

NEXT_VIEW = Seam(Exchange, "next_view")
SCALES_LENS = Seam(exchange, "scaled")
PUBLISHES = Seam(Exchange, "publish")
ENDS_LEASES = Seam(Exchange, "forget")
OWES_MORE = Seam(Exchange, "renew")
NEEDS_OF_READER = Seam(Reader, "needs")
LEASES_NEWEST = Seam(Exchange, "lend")
TELLS_OF_IMAGE = Seam(Reader, "frame")
LEASES_SLOT = Seam(Ring, "lease")
CHOOSES_SLOT = Seam(Ring, "begin_write")

# The memory that they lie in

ALLOCATES = Seam(Memory, "__init__")
CREATES_SEGMENT = Seam(shared_memory, "create")
LAYS_OUT_RING = Seam(memory, "host_ring")
WRITES_IMAGE = Seam(Memory, "writer")
MAKES_SUCCESSOR = Seam(Memory, "successor")
FREES_MEMORY = Seam(Memory, "close")
REMOVES_SEGMENT = Seam(memory, "remove_if_owner")
