"""Poses and frames that are plainly valid, at random."""

from hypothesis import strategies as st
from splatbus_schemas import LIMITS
from splatbus_wire.messages import CameraPose, Frame, FrameCamera, Placement, PointCloudPose, Pose

from tests.wire.stress import positions, quaternions

FARTHEST = LIMITS["max_position"]


def sizes(least: int) -> st.SearchStrategy[int]:
    return st.integers(least, LIMITS["max_image_size"])


plain_text = st.characters(min_codepoint=32, max_codepoint=126, exclude_characters='"\\')
plain_names = st.text(plain_text, min_size=1, max_size=LIMITS["max_tag_chars"])
floats = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(5e-324, 1e300)
poses = st.builds(
    Pose,
    positions | st.sampled_from([(FARTHEST, -FARTHEST, 0.0)]),
    quaternions() | st.sampled_from([(0.0, 0.0, 0.0, 0.9901), (0.0, -1.0099, 0.0, 0.0)]),
)
plain_poses = st.builds(
    CameraPose, poses, st.none() | floats, st.none() | plain_names, st.none()
) | st.builds(PointCloudPose, poses, st.none() | floats)
frame_cameras = st.builds(
    lambda near_and_far, tag, *others: FrameCamera(*others, *near_and_far, tag),
    st.lists(positive, min_size=2, max_size=2, unique=True).map(sorted),
    st.none() | plain_names,
    *(poses, positive, positive, floats, floats, sizes(1), sizes(1)),
)
plain_frames = st.builds(
    Frame,
    st.integers(1, LIMITS["max_safe_integer"]),
    st.integers(0, LIMITS["max_safe_integer"]),
    st.integers(0, LIMITS["max_slots"] - 1),
    frame_cameras,
    floats,
    floats,
    st.lists(
        st.builds(Placement, plain_names, poses, positive),
        max_size=3,
        unique_by=lambda each: each.object,
    ).map(tuple),
)
