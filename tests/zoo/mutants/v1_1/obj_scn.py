"""Mutants that break OBJ, SCN and TIM-4: where objects are, and what they say of their scene."""

from dataclasses import replace
from typing import Any

import numpy as np
from splatbus_server import api
from splatbus_server.session import MESSAGE_CAPABILITIES
from splatbus_server.view import View
from splatbus_wire.messages import Box, PointCloudPose
from splatbus_wire.poses import Pose

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer, server, wire
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.jsn.servers import trusts_its_scene
from tests.zoo.mutants.v1_1.cam.lenses import read_again
from tests.zoo.mutants.v1_1.ctl import unsaid

LISTED, PUT = "check_frames_list_what_was_moved", "check_objects_are_where_they_were_put"
CAMERAS = {"cameras": [Pose((float(n), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for n in range(3)]}
KEEPS, SCENE = "check_keeps_the_former_pose_of_an_object", "check_tells_of_its_scene"


def objects_told(patch, change):
    """Change what frames list."""

    def told(frame):
        return frame | {"objects": change(frame["objects"])} if frame.get("objects") else frame

    messages(patch, of_type("frame", told))


@mutant(
    "OBJ-2",
    check="check_point_cloud_pose_is_of_the_default_object",
    code="another-placement",
    at=server.APPLIES_POSE,
)
def server_keeps_the_scale(original, self, message):
    """Leaves the scale of the Gaussians as it was with a pose that has none."""
    after = original(self, message)
    if not isinstance(message, PointCloudPose):
        return after
    scale = self.objects["default"].scale
    placed = {"default": after.objects["default"]._replace(scale=scale)}
    return after._replace(objects={**after.objects, **placed})


@mutant("OBJ-3", check="check_reports_unknown_objects", code="no-error")
def server_ignores_unknown_objects(patch):
    """Says nothing of an object that it has not."""
    unsaid(patch, "unknown_object")


@mutant("OBJ-3", check="check_reports_unknown_objects", code="another-error")
def server_does_not_point_at_objects(patch):
    """Reports an unknown object, and does not say where."""

    def bare(error):
        unknown = error["code"] == "unknown_object"
        return {n: it for n, it in error.items() if not (unknown and n == "pointer")}

    messages(patch, of_type("error", bare))


@mutant("OBJ-4", check=KEEPS, code="applies")
def server_takes_any_scale(patch):
    """Takes a scale that is none for 1."""
    read_again(patch, wire.POSE_OF_OBJECT, lambda message: message | {"scale": 1.0})


@mutant("OBJ-5", check=PUT, code="other-colours")
def server_scales_nothing(patch):
    """Renders every object in its own size."""
    renderer.POSE_IN_VIEW.wrap(
        patch,
        lambda original, *arguments: replace(original(*arguments), scale=1.0),
    )


@mutant("OBJ-5", check=PUT, code="other-colours", at=renderer.POSE_IN_VIEW)
def server_scales_where_objects_are(original, *arguments):
    """Scales an object's position as well."""
    asked = original(*arguments)
    x, y, z = asked.position
    return replace(asked, position=(asked.scale * x, asked.scale * y, asked.scale * z))


@mutant("OBJ-5", check=PUT, code="other-colours")
def server_moves_all_objects_at_once(patch):
    """Puts every object where the default one is."""
    Seam(View, "of").wrap(patch, lambda original, self, name: self)


@mutant(
    "OBJ-6", check="check_depth_is_in_world_units", code="other-depths", at=renderer.RENDERS_IMAGE
)
def server_stores_depth_in_units_of_the_object(original, self, scene, camera, wanted=True):
    """Stores depths as the renderer has them, in the units of what is seen."""
    image = original(self, scene, camera, wanted)
    if image.depth is None:
        return image
    return image._replace(depth=(image.depth / scene.pose.scale).astype(np.float32))


@mutant("OBJ-7", check=LISTED, code="object-not-listed")
def server_does_not_say_where_objects_are(patch):
    """Leaves objects out of its frames."""
    messages(patch, of_type("frame", lambda m: {n: it for n, it in m.items() if n != "objects"}))


@mutant("OBJ-7", check=LISTED, code="object-not-listed")
def server_says_where_objects_were(patch):
    """Lists in each frame what was to be listed before that was last changed."""
    former: list[Any] = []

    def before(objects):
        if objects not in former[-1:]:
            former.append(objects)
        return former[-2:][0]

    objects_told(patch, before)


@mutant("OBJ-7", code="missing-member", through="OBJ-7")
def server_tells_no_scale(patch):
    """Lists objects without their scale."""
    objects_told(
        patch, lambda objects: [{n: v for n, v in it.items() if n != "scale"} for it in objects]
    )


def scene_told(patch, change):
    """Change what is told of the scene."""
    messages(patch, of_type("scene", lambda scene: scene | change(scene)))


@mutant("SCN-2", check=SCENE, code="unknown-object")
def server_lists_an_object_that_is_not_there(patch):
    """Tells of a chair that nobody can move."""
    chair = {"id": "chair", "name": "", "gaussians": 0, "bounds": None}
    scene_told(patch, lambda scene: {"objects": [*scene["objects"], chair]})


@mutant("SCN-2", check=SCENE, code="bounds-moved", at=server.ANSWERS_REQUEST)
def server_tells_bounds_in_the_world(original, self, *request):
    """Tells where the Gaussians are now, and not where they are in their own axes."""
    x, y, z = self.control.poses.objects["default"].pose.position
    default, *others = self.scene.objects
    least, most = ((a + x, b + y, c + z) for a, b, c in default.bounds or ())
    moved = default._replace(bounds=Box(least, most))
    scene, self.scene = self.scene, self.scene._replace(objects=(moved, *others))
    try:
        return original(self, *request)
    finally:
        self.scene = scene


@mutant("SCN-2", check=SCENE, code="another-count")
def server_forgets_a_camera(patch):
    """Tells of one camera fewer than it has."""
    renderer.SERVES.wrap(patch, lambda original, *a, **named: original(*a, **named | CAMERAS))
    scene_told(patch, lambda scene: {"cameras": scene["cameras"] - 1})


@mutant("SCN-2", check=SCENE, code="another-origin")
def server_tells_another_origin(patch):
    """Tells another origin than its init packet does."""
    scene_told(patch, lambda scene: {"origin": [1.0, 2.0, 3.0]})


@mutant("SCN-2", code="min-beyond-max", through="SCN-2")
def server_turns_bounds_round(patch):
    """Swaps the ends of bounds."""
    trusts_its_scene(patch)

    def turned(item):
        box = item["bounds"]
        return item | {"bounds": box and {"min": box["max"], "max": box["min"]}}

    scene_told(patch, lambda scene: {"objects": [turned(it) for it in scene["objects"]]})


@mutant("TIM-4", check="check_grants_time_to_the_animated_alone", code="no-time-range")
def server_grants_time_of_a_still_scene(patch):
    """Grants `time`, whether or not anything moves."""
    scene_told(patch, lambda scene: {"timeRange": None})
    Seam(api, "Terms").wrap(
        patch,
        lambda original, server, offered, token: original(
            server, offered | {"msg": MESSAGE_CAPABILITIES}, token
        ),
    )
