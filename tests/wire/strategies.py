"""Every message that the protocol defines, at random and valid."""

import json
import math
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS
from splatbus_wire.fields import ROUNDS_TO_INFINITY
from splatbus_wire.init_packet import (
    CudaMemory,
    HostMemory,
    InitPacket,
    LegacyBuffers,
    Slots,
    host_ring,
)
from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    Box,
    CameraPose,
    CameraReply,
    Closed,
    ErrorMessage,
    Frame,
    FrameCamera,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Histogram,
    Intrinsics,
    ObjectPose,
    Opened,
    OpenFailed,
    Ping,
    Placement,
    PointCloudPose,
    Pong,
    Pose,
    Program,
    Release,
    Scalar,
    Scene,
    SceneObject,
    SetTime,
    SetViewport,
    Subscribe,
    SubscribeTelemetry,
    Telemetry,
    Text,
    ViewportSize,
    Welcome,
)
from splatbus_wire.semantics import Semantics

from tests.wire.stress import positions, quaternions

MAX_INTEGER = LIMITS["max_safe_integer"]
FARTHEST = LIMITS["max_position"]
DEEPEST = math.nextafter(ROUNDS_TO_INFINITY, 0.0)
CODES = (
    "malformed_packet packet_too_large unsupported_version unauthorized too_many_clients"
    " malformed_json not_an_object unknown_type invalid_message invalid_rotation invalid_number"
    " unsupported unknown_object busy internal"
).split()


def text(least: int, most: int) -> st.SearchStrategy[str]:
    return st.text(st.characters(exclude_categories=["Cs"]), min_size=least, max_size=most)


def sizes(least: int) -> st.SearchStrategy[int]:
    return st.integers(least, LIMITS["max_image_size"])


floats = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(5e-324, 1e300)
timestamps = st.none() | floats
ids = st.none() | st.integers(0, MAX_INTEGER)
generations = st.integers(1, MAX_INTEGER)
seqs = st.integers(0, MAX_INTEGER)
versions = st.builds("{}.{}".format, st.integers(0, 99), st.integers(0, 10**60))
names = text(0, LIMITS["max_name_chars"])
name_lists = st.lists(names, unique=True, max_size=LIMITS["max_capabilities"]).map(tuple)
programs = st.builds(Program, names, names)

poses = st.builds(
    Pose,
    positions | st.sampled_from([(FARTHEST, -FARTHEST, 0.0)]),
    quaternions() | st.sampled_from([(0.0, 0.0, 0.0, 0.9901), (0.0, -1.0099, 0.0, 0.0)]),
)


def planes(number: st.SearchStrategy[float]) -> st.SearchStrategy[list[float]]:
    """Clipping planes, near and far."""
    return st.lists(number, min_size=2, max_size=2, unique=True).map(sorted)


lengths = st.floats(LIMITS["min_lens"], LIMITS["max_lens"])
principal_points = st.floats(-LIMITS["max_lens"], LIMITS["max_lens"])
tags = st.none() | text(1, LIMITS["max_tag_chars"])
intrinsics = st.builds(
    lambda near_and_far, *others: Intrinsics(*others, *near_and_far),
    planes(lengths),
    *(lengths, lengths, principal_points, principal_points, sizes(1), sizes(1)),
)
labels = text(1, LIMITS["max_name_chars"])
scales = st.floats(LIMITS["min_scale"], LIMITS["max_scale"])

poses_of_1_0 = st.builds(CameraPose, poses, timestamps, st.none(), st.none()) | st.builds(
    PointCloudPose, poses, timestamps
)
steerings = (
    st.builds(CameraPose, poses, timestamps, tags, st.none() | intrinsics)
    | st.builds(PointCloudPose, poses, timestamps)
    | st.builds(ObjectPose, labels, poses, scales, timestamps)
    | st.builds(SetTime, floats)
)
requests_of_1_0 = st.builds(GetViewportSize, ids, timestamps) | st.builds(
    GetCameraPose, st.integers(-MAX_INTEGER, MAX_INTEGER), ids, timestamps
)
requests = (
    requests_of_1_0
    | st.builds(GetScene, ids)
    | st.builds(SetViewport, sizes(1), sizes(1), ids)
    | st.builds(Ping, floats, ids)
)

vectors = st.tuples(floats, floats, floats)
boxes = st.tuples(vectors, vectors).map(
    lambda pair: Box(*(tuple(map(end, *pair)) for end in (min, max)))
)


def scene_objects(identifier: str) -> st.SearchStrategy[SceneObject]:
    return st.builds(SceneObject, st.just(identifier), names, seqs, st.none() | boxes)


scenes = st.builds(
    Scene,
    st.lists(labels.filter(lambda name: name != DEFAULT_OBJECT), unique=True, max_size=4)
    .map(lambda others: [DEFAULT_OBJECT, *others])
    .flatmap(st.permutations)
    .flatmap(lambda ids: st.tuples(*map(scene_objects, ids))),
    st.none() | st.tuples(floats, floats).map(sorted).map(tuple),
    seqs,
    vectors,
    ids,
)
replies_of_1_0 = st.builds(ViewportSize, sizes(0), sizes(0), ids) | st.builds(
    CameraReply, poses, ids, st.none()
)
replies = (
    st.builds(ViewportSize, sizes(0), sizes(0), ids)
    | st.builds(CameraReply, poses, ids, st.none() | intrinsics)
    | scenes
    | st.builds(Pong, floats, floats, ids)
)

histograms = st.lists(floats, min_size=2, max_size=6, unique=True).flatmap(
    lambda edges: st.builds(
        Histogram,
        labels,
        st.just(tuple(sorted(edges))),
        st.tuples(*[seqs] * (len(edges) - 1)),
    )
)
series = (
    st.builds(Scalar, labels, floats, st.none() | names)
    | histograms
    | st.builds(Text, labels, text(0, 80))
)
telemetries = st.builds(
    Telemetry,
    seqs,
    floats,
    st.lists(series, min_size=1, max_size=5, unique_by=lambda each: each.name).map(tuple),
)
subscriptions = st.builds(
    SubscribeTelemetry, st.none() | st.frozensets(labels, max_size=LIMITS["max_series"])
)
hellos = st.builds(
    Hello,
    st.lists(versions, min_size=1, max_size=LIMITS["max_versions"]).map(tuple),
    programs,
    name_lists,
    st.none() | text(1, LIMITS["max_token_chars"]),
)
welcomes = st.builds(Welcome, versions, programs, name_lists)
errors = st.builds(
    ErrorMessage,
    st.sampled_from([code for code in CODES if code != "unsupported_version"]),
    text(0, 40),
    ids,
    st.none() | st.sampled_from(["", "/position/x", "/a~1b/~0"]),
    st.none(),
) | st.builds(
    ErrorMessage,
    st.just("unsupported_version"),
    text(0, 40),
    st.none(),
    st.none(),
    st.just(("1.1", "1.0")),
)
ipc_replies = (
    st.builds(Opened, generations)
    | st.builds(OpenFailed, generations, text(1, 80))
    | st.builds(Closed, generations)
    | st.builds(Release, generations, seqs)
    | st.builds(Subscribe, st.sampled_from([{"color"}, {"depth"}, {"color", "depth"}]))
)
frame_cameras = st.builds(
    lambda near_and_far, tag, *others: FrameCamera(*others, *near_and_far, tag),
    planes(positive),
    tags,
    *(poses, positive, positive, floats, floats, sizes(1), sizes(1)),
)
placements = st.lists(
    st.builds(Placement, labels, poses, positive), max_size=3, unique_by=lambda each: each.object
).map(tuple)
frames = st.builds(
    Frame,
    generations,
    seqs,
    st.integers(0, LIMITS["max_slots"] - 1),
    frame_cameras,
    floats,
    floats,
    placements,
)

handles = st.binary(min_size=LIMITS["handle_bytes"], max_size=LIMITS["handle_bytes"])
legacy_buffers = st.builds(
    LegacyBuffers,
    handles,
    handles,
    handles,
    st.integers(0, MAX_INTEGER // 16).map(lambda n: 16 * n),
    st.integers(0, MAX_INTEGER // 4).map(lambda n: 4 * n),
    st.none() | st.integers(0, MAX_INTEGER),
)
semantics = st.builds(
    Semantics,
    st.sampled_from(["straight", "premultiplied"]),
    st.sampled_from(["srgb", "linear"]),
    st.sampled_from(["planar_z", "ray_distance"]),
    st.sampled_from(["harmonic", "expected", "median"]),
    st.just(math.inf) | st.floats(-DEEPEST, DEEPEST),
    st.none() | positive,
    vectors,
)
shm_names = st.from_regex(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,29}", fullmatch=True)
uuids = st.uuids().map("GPU-{}".format)


@st.composite
def init_packets(draw: st.DrawFn) -> InitPacket:
    width, height = draw(sizes(1)), draw(sizes(1))
    kind = draw(st.sampled_from(["1.0", "host_shm", "cuda_ipc"]))
    if kind == "1.0":
        return InitPacket(width, height, draw(legacy_buffers))
    slots = draw(st.integers(1, 5))
    ring, size = host_ring(width, height, slots)
    if kind == "host_shm":
        memory, legacy = HostMemory(draw(shm_names), size), None
    else:
        memory, legacy = CudaMemory(draw(uuids), draw(handles), size), draw(legacy_buffers)
        ring = draw(st.none() | st.just(ring._replace(events=(draw(handles),) * slots)))
    return InitPacket(
        width, height, legacy, "1.1", draw(generations), memory, ring, draw(semantics)
    )  # fmt: skip


def rings(width: int, height: int) -> st.SearchStrategy[Slots]:
    """Rings whose slots are large enough, wherever they lie."""
    units = st.integers(0, 40).map(lambda n: 16 * n)
    color_bytes, depth_bytes = 16 * width * height, -(-4 * width * height // 16) * 16
    return st.builds(
        Slots,
        st.integers(1, 4),
        units,
        units.map(lambda gap: color_bytes + gap),
        units,
        units.map(lambda gap: depth_bytes + gap),
        st.just(()),
    )


bits = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=5,
)


@st.composite
def damaged(draw: st.DrawFn, message: Any) -> Any:
    """A valid message, one value of which at any depth is another or is not there."""
    message = json.loads(json.dumps(message))
    place = message
    while True:
        name = draw(
            st.sampled_from(sorted(place) if isinstance(place, dict) else range(len(place)))
        )
        inner = place[name]
        if not isinstance(inner, dict | list) or not inner or draw(st.booleans()):
            break
        place = inner
    if draw(st.booleans()) and isinstance(place, dict):
        del place[name]
    else:
        place[name] = draw(bits)
    return message
