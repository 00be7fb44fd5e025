"""The reference client: a session with a server, and frames without copies.

Sockets, threads and memory are at its rim (`channel`, `session`, `reading`); what the protocol asks
is in `message_protocol` and `ipc_protocol`, which do no I/O. What is shown to a person, and how,
is `splatbus_viewer`.
"""

from splatbus_wire.messages import FrameCamera, Intrinsics, Placement, Scene, Telemetry
from splatbus_wire.poses import Pose

from splatbus_client.channel import ChannelStatus
from splatbus_client.clock import Sample
from splatbus_client.lease import FrameLease
from splatbus_client.mapping import MemoryLostError
from splatbus_client.message_protocol import NotOfferedError
from splatbus_client.session import Session, connect
from splatbus_client.status import Status
from splatbus_client.steering import ServerRefusedError

__all__ = [
    "connect",
    "Session",
    "FrameLease",
    "FrameCamera",
    "Intrinsics",
    "Placement",
    "Pose",
    "Sample",
    "Scene",
    "Telemetry",
    "Status",
    "ChannelStatus",
    "ServerRefusedError",
    "NotOfferedError",
    "MemoryLostError",
]
