"""Where images of the harness are said to be seen from (spec 1.1 chapter 6)."""

from dataclasses import dataclass

from splatbus_conformance.rules.v1_0 import pos
from splatbus_conformance.rules.v1_1 import cam
from splatbus_conformance.wire.json_values import MAX_CHARS, text_of
from splatbus_conformance.wire.messages import Json


@dataclass(frozen=True)
class Viewpoint:
    """The newest pose that a client sent with a tag or with intrinsics.

    Others change nothing here: checks lend images from where they like.
    """

    pose: Json
    lens: Json | None = None
    """The intrinsics in force: those of the pose, or of one before it (CAM-7)."""

    @property
    def tag(self) -> str | None:
        """The tag of the pose."""
        tag = self.pose.get("tag")
        return tag if text_of(tag, 1, MAX_CHARS) else None

    def camera(self, width: int, height: int) -> Json:
        """The members of `frame.camera` that it decides, for images of this size (CAM-5)."""
        seen_from = {
            name: [self.pose[name][axis] for axis in axes] for name, axes in pos.MEMBERS.items()
        }
        return seen_from | (scaled(self.lens, width, height) if self.lens else {})


def viewpoint(pose: Json, before: Viewpoint | None, *, lens: bool) -> Viewpoint | None:
    """What a `camera_pose` makes of the viewpoint before it; `lens`: intrinsics are agreed."""
    former = before.lens if before else None
    given = pose.get("intrinsics") if lens else None
    judgements = [*pos.pose(pose), *(cam.lens(pose, "camera_pose") if given is not None else ())]
    if any(it.breach for it in judgements) or not ({"tag", "intrinsics"} & pose.keys()):
        return before
    return Viewpoint(pose, given or former)


def scaled(lens: Json, width: int, height: int) -> Json:
    """Intrinsics for an image of another size (CAM-5)."""
    across, down = width / lens["width"], height / lens["height"]
    return {
        "fx": lens["fx"] * across,
        "fy": lens["fy"] * down,
        "cx": lens["cx"] * across,
        "cy": lens["cy"] * down,
        "width": width,
        "height": height,
        "near": lens["near"],
        "far": lens["far"],
    }
