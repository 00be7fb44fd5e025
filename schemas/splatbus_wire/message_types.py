"""The messages of both channels as plain values (1.0 chapter 6; 1.1 chapters 2, 4 and 5)."""

from typing import NamedTuple

from splatbus_wire.init_packet import InitPacket
from splatbus_wire.poses import Pose


class CameraPose(NamedTuple):
    """Where the camera is [POS-1]; `timestamp` in seconds of the client's choice [POS-8]."""

    pose: Pose
    timestamp: float | None = None


class PointCloudPose(NamedTuple):
    """Where the Gaussians are [POS-1]; `timestamp` in seconds of the client's choice [POS-8]."""

    pose: Pose
    timestamp: float | None = None


class GetViewportSize(NamedTuple):
    """Asks for the size of the image [REQ-1]; `id` only after `welcome` [NEG-27]."""

    id: int | None = None
    timestamp: float | None = None


class GetCameraPose(NamedTuple):
    """Asks for camera `cam_idx` modulo their number [REQ-2]; `id` only after `welcome` [NEG-27]."""

    cam_idx: int
    id: int | None = None
    timestamp: float | None = None


class ViewportSize(NamedTuple):
    """Answers GetViewportSize, in pixels; 0 by 0 while the server has no image [REQ-3, REQ-4]."""

    width: int
    height: int
    id: int | None = None


class CameraReply(NamedTuple):
    """Answers GetCameraPose, camera-to-world [REQ-5]."""

    pose: Pose
    id: int | None = None


class Program(NamedTuple):
    """A peer's name and version, for logs and reports."""

    name: str
    version: str


class Hello(NamedTuple):
    """What a client speaks, the version it likes best first, and can do on a channel [NEG-2]."""

    versions: tuple[str, ...]
    client: Program
    capabilities: tuple[str, ...]
    token: str | None = None

    def __repr__(self) -> str:
        """Without the token: what is logged must not grant access."""
        token = None if self.token is None else "…"
        return (
            f"Hello(versions={self.versions!r}, client={self.client!r},"
            f" capabilities={self.capabilities!r}, token={token!r})"
        )


class Welcome(NamedTuple):
    """The version and the capabilities that a connection has from now on [NEG-30]."""

    version: str
    server: Program
    capabilities: tuple[str, ...]


class ErrorMessage(NamedTuple):
    """What was wrong with a message [NEG-23]; `supported` with `unsupported_version` [NEG-10]."""

    code: str
    message: str
    id: int | None = None
    pointer: str | None = None
    supported: tuple[str, ...] | None = None


class Opened(NamedTuple):
    """The memory of a generation is mapped and checked [OPN-2, OPN-13]."""

    generation: int


class OpenFailed(NamedTuple):
    """The memory of a generation cannot be used [OPN-3, OPN-13]."""

    generation: int
    reason: str


class Closed(NamedTuple):
    """The memory of a generation is no longer mapped [OPN-5, OPN-13]."""

    generation: int


class Release(NamedTuple):
    """The slot of a frame is not read any more [IMG-12, IMG-13]."""

    generation: int
    seq: int


class Subscribe(NamedTuple):
    """Which of `color` and `depth` the frames of a connection need to hold [IMG-19]."""

    channels: frozenset[str]


class FrameCamera(NamedTuple):
    """The camera of an image: pose, intrinsics and size in pixels, clipping planes in scene units.

    Pixel centres are at half-integers: (0.5, 0.5) is the centre of the top-left pixel.
    """

    pose: Pose
    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    near: float
    far: float


class Frame(NamedTuple):
    """An image that is whole, and lent until it is released [IMG-1].

    `time` is in seconds of the scene, `rendered_at` in seconds of the server's monotonic clock.
    """

    generation: int
    seq: int
    slot: int
    camera: FrameCamera
    time: float
    rendered_at: float


Request = GetViewportSize | GetCameraPose
Reply = ViewportSize | CameraReply
ClientMessage = (
    CameraPose
    | PointCloudPose
    | Request
    | Hello
    | Opened
    | OpenFailed
    | Closed
    | Release
    | Subscribe
)
ServerMessage = InitPacket | Reply | Welcome | Frame | ErrorMessage
Message = ClientMessage | ServerMessage
