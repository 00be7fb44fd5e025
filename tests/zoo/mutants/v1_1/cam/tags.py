"""Mutants that break CAM: which tags they return, and when."""

from typing import Any

from splatbus_wire.messages import CameraPose

from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant

FIRST, OTHERS = "check_tags_come_with_the_first_image", "check_no_other_tags_come"


def tags(patch, change):
    """Give frames other tags: `change` is given the reader, the image and the tag."""

    def frame(original, self, image):
        told = original(self, image)
        camera = told.camera._replace(tag=change(self, image, told.camera.tag))
        return told._replace(camera=camera)

    server.TELLS_OF_IMAGE.wrap(patch, frame)


@mutant("CAM-2", check=FIRST, code="another-tag")
def server_returns_no_tags(patch):
    """Never says which pose an image shows."""
    tags(patch, lambda reader, image, tag: None)


@mutant("CAM-2", code="another-tag", through="CAM-2")
def server_forgets_every_third_tag(patch):
    """Leaves out each third tag."""
    count = [0]

    def third(reader, image, tag):
        count[0] += tag is not None
        return tag if count[0] % 3 else None

    tags(patch, third)


@mutant("CAM-2", check=FIRST, code="another-tag")
def server_tells_tags_to_one_reader(patch):
    """Tells each tag once, to whoever is sent the image first."""
    told: set[str] = set()

    def once(reader, image, tag):
        if tag in told:
            return None
        told.add(tag)
        return tag

    tags(patch, once)


@mutant("CAM-2", check=FIRST, code="no-tag", at=server.APPLIES_POSE)
def server_takes_equal_poses_for_one(original, self, message):
    """Does not look at a pose that has the values of the one before it."""
    same = isinstance(message, CameraPose) and message.pose == self.camera
    return self if same else original(self, message)


@mutant("CAM-3", check=OTHERS, code="tag-twice")
def server_tells_tags_again(patch):
    """Gives every image the tag of its pose."""
    tags(patch, lambda reader, image, tag: image.view.poses.tag)


@mutant("CAM-3", code="too-often", through="CAM-3")
def server_tells_tags_twice(patch):
    """Gives an image without a tag the last one that there was."""
    last: list[Any] = [None]

    def lasting(reader, image, tag):
        last[0] = tag or last[0]
        return last[0]

    tags(patch, lasting)


@mutant("CAM-3", check=OTHERS, code="tag-of-another-pose")
def server_is_one_tag_late(patch):
    """Gives each image the tag that the one before it should have had."""
    kept: dict[int, Any] = {}

    def former(reader, image, tag):
        before, kept[id(reader)] = kept.get(id(reader)), tag
        return before

    tags(patch, former)


@mutant("CAM-3", check=OTHERS, code="unknown-tag")
def server_makes_tags_up(patch):
    """Gives images without a tag their number for one."""
    tags(patch, lambda reader, image, tag: tag or f"image {image.seq}")
