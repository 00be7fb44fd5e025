"""The client: its connections, what it takes on each channel, and the memory of the images."""

from splatbus_client import channel, host_memory, ipc_protocol, message_protocol, reading
from splatbus_client.channel import Channel
from splatbus_client.host_memory import HostImages
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_client.reading import Reading
from splatbus_client.session import Session
from splatbus_client.steering import Steering

from tests.zoo.faults.seam import Seam

# Either channel

CONNECTS = Seam(Channel, "connect")
LOSES_CONNECTION = Seam(Channel, "lose")
FLUSHES = Seam(Channel, "flush")
DELAYS_OF_ATTEMPTS = Seam(channel, "delays")

# The IPC channel: what comes, then what is said

BEGINS_ON_IPC = Seam(IpcProtocol, "__init__")
RECEIVES_ON_IPC = Seam(IpcProtocol, "receive")
DEADLINE_ON_IPC = Seam(IpcProtocol, "deadline")
EXPIRES_ON_IPC = Seam(IpcProtocol, "expire")
READS_ON_IPC = Seam(ipc_protocol, "decode_from_server_ipc")
READS_WHAT_IS_BROKEN = Seam(ipc_protocol, "parse_object")
TAKES_PAYLOAD_ON_IPC = Seam(IpcProtocol, "on_payload")
TAKES_BROKEN_PACKET = Seam(IpcProtocol, "on_broken")
TAKES_WELCOME_ON_IPC = Seam(IpcProtocol, "on_welcome")
TAKES_INIT_PACKET = Seam(IpcProtocol, "on_init_packet")
TAKES_FRAME = Seam(IpcProtocol, "on_frame")
TAKES_INIT_PACKET_OF_1_0 = Seam(IpcProtocol, "on_init_packet_of_1_0")
SAYS_OPENED = Seam(IpcProtocol, "opened")
SAYS_OPEN_FAILED = Seam(IpcProtocol, "open_failed")
SAYS_CLOSED = Seam(IpcProtocol, "closed")
RELEASES = Seam(IpcProtocol, "release")

# The message channel

SENDS_MESSAGES = Seam(MessageProtocol, "data_to_send")
PAUSE_TO_ASK_AGAIN = Seam(message_protocol, "ASK_AGAIN_SECONDS")
RECEIVES_MESSAGES = Seam(MessageProtocol, "receive")
READS_MESSAGE = Seam(message_protocol, "decode_from_server_message")
TAKES_PAYLOAD = Seam(MessageProtocol, "on_payload")
TAKES_WELCOME = Seam(MessageProtocol, "on_welcome")
TAKES_REPLY = Seam(MessageProtocol, "on_reply")
TAKES_ERROR = Seam(MessageProtocol, "on_error")
ASKS = Seam(MessageProtocol, "ask")
CUTS_TO_WHAT_WAS_AGREED = Seam(message_protocol, "permitted")
BEGINS_TO_STEER = Seam(Steering, "begin")
SENDS_CAMERA = Seam(Session, "send_camera")

# Images

CAPABILITIES_ON_IPC = Seam(reading, "CAPABILITIES")
HANDS_OUT = Seam(Reading, "hold")
ENDS_READING = Seam(Reading, "end")
IS_LENT_FRAME = Seam(Reading, "take_frame")
OPENS_MEMORY = Seam(reading, "HostImages")
MAPS_MEMORY = Seam(host_memory, "map_memory")
BEGINS_WITH_MEMORY = Seam(HostImages, "__init__")
UNMAPS_MEMORY = Seam(HostImages, "close")
COLOR_OF_SLOT = Seam(HostImages, "color")
DEPTH_OF_SLOT = Seam(HostImages, "depth")
