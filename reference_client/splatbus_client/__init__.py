"""The reference client: a session with a server, frames without copies, and a small viewer."""

from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import Pose

from splatbus_client.channel import ChannelStatus
from splatbus_client.lease import FrameLease
from splatbus_client.session import Session, Status, connect
from splatbus_client.steering import ServerRefusedError

__all__ = [
    "connect",
    "Session",
    "FrameLease",
    "FrameCamera",
    "Pose",
    "Status",
    "ChannelStatus",
    "ServerRefusedError",
]
