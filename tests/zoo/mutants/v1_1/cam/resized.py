"""Mutants that are right until images change their size."""

from dataclasses import replace
from typing import Any

import numpy as np
from splatbus_server.reader import Reader
from splatbus_wire.messages import GetCameraPose, ViewportSize
from splatbus_wire.poses import IDENTITY

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant

EVERY_READER = "check_tells_every_reader_of_another_size"


@mutant("BUF-3", check="check_colours_are_from_0_to_1", code="out-of-range", at=server.WRITES_IMAGE)
def server_leaves_a_corner_undefined_in_another_size(original, self, *image):
    """Stores no number in one corner of images that have another size than the first."""
    write = original(self, *image)

    def written(slot, wants):
        write(slot, wants)
        if self.generation > 1 and "color" in wants:
            self.color(slot)[0, 0, 0] = np.nan

    return written


@mutant(
    "CAM-3",
    check="check_no_tag_comes_again_in_another_size",
    code="tag-twice",
    at=Seam(Reader, "open"),
)
def server_repeats_a_tag_in_another_size(original, self, generation):
    """Forgets which poses a reader has seen when it opens other memory."""
    self.shown = 0
    original(self, generation)


@mutant("CAM-6", check="check_compares_shapes_with_the_size_now", code="refused")
def server_compares_shapes_with_its_first_size(patch):
    """Refuses intrinsics by the size that images had at first."""
    first: list[tuple[int, int]] = []

    def fits(original, lens, *size):
        first.append((size[0], size[1]))
        return bool(original(lens, *first[0]))

    server.JUDGES_SHAPE_OF_LENS.wrap(patch, fits)


@mutant("CAM-8", check="check_tells_lenses_for_the_size_now", code="wrong-size")
def server_tells_lenses_for_its_first_size(patch):
    """Tells its cameras with the intrinsics that it had at first."""
    first: list[Any] = []

    def answer(original, self, connection, request, *a):
        exchange = self.exchange
        now = exchange.lens
        first.append(now)
        if isinstance(request, GetCameraPose):
            exchange.lens = first[0]
        try:
            return original(self, connection, request, *a)
        finally:
            exchange.lens = now

    server.ANSWERS_REQUEST.wrap(patch, answer)


@mutant("VPT-5", check=EVERY_READER, code="no-init-packet", at=server.BEGINS_OTHER_SIZE)
def server_sees_no_other_height(original, self, asker, request):
    """Takes a size of the same width for the one that images have."""
    if self.exchange.memory.width == request.width:
        asker.send(ViewportSize(*request))
    else:
        original(self, asker, request)


@mutant("POS-7", check="check_the_camera_stays_in_another_size", code="another-camera")
def server_begins_another_size_at_the_origin(patch):
    """Renders the first image of another size from where the server has begun."""
    begun = {1}

    def next_view(original, self, *arguments):
        view = original(self, *arguments)
        if view is None or view.generation in begun:
            return view
        begun.add(view.generation)
        return replace(view, poses=view.poses._replace(camera=IDENTITY))

    server.NEXT_VIEW.wrap(patch, next_view)


@mutant(
    "CTL-5", check="check_scales_a_lens_that_waited", code="other-intrinsics", at=server.SCALES_LENS
)
def server_scales_lenses_by_the_height(original, lens, width, height):
    """Scales every lens as much across as down, whatever shape it is of."""
    return original(lens, round(lens.width * height / lens.height), height)
