"""Mutants that are right until images change their size."""

from dataclasses import replace
from typing import Any

import numpy as np
from splatbus_server.connection import Connection
from splatbus_server.exchange import Exchange
from splatbus_server.memory import Memory
from splatbus_server.reader import Reader
from splatbus_server.session import Session
from splatbus_server.viewport import Viewport
from splatbus_wire.messages import GetCameraPose, SetViewport, ViewportSize
from splatbus_wire.poses import IDENTITY

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant

EVERY_READER = "check_tells_every_reader_of_another_size"


@mutant("BUF-3", check="check_colours_are_from_0_to_1", code="out-of-range")
def server_leaves_a_corner_undefined_in_another_size(patch: Patch) -> None:
    """Stores no number in one corner of images that have another size than the first."""

    def writer(original: Any, self: Memory, *image: Any) -> Any:
        write = original(self, *image)

        def written(slot: int, wants: Any) -> None:
            write(slot, wants)
            if self.generation > 1 and "color" in wants:
                self.color(slot)[0, 0, 0] = np.nan

        return written

    server.WRITES_IMAGE.wrap(patch, writer)


@mutant("CAM-3", check="check_no_tag_comes_again_in_another_size", code="tag-twice")
def server_repeats_a_tag_in_another_size(patch: Patch) -> None:
    """Forgets which poses a reader has seen when it opens other memory."""

    def opened(original: Any, self: Reader, generation: int) -> None:
        self.shown = 0
        original(self, generation)

    Seam(Reader, "open").wrap(patch, opened)


@mutant("CAM-6", check="check_compares_shapes_with_the_size_now", code="refused")
def server_compares_shapes_with_its_first_size(patch: Patch) -> None:
    """Refuses intrinsics by the size that images had at first."""
    first: list[tuple[int, int]] = []

    def fits(original: Any, lens: Any, *size: int) -> bool:
        first.append((size[0], size[1]))
        return bool(original(lens, *first[0]))

    server.JUDGES_SHAPE_OF_LENS.wrap(patch, fits)


@mutant("CAM-8", check="check_tells_lenses_for_the_size_now", code="wrong-size")
def server_tells_lenses_for_its_first_size(patch: Patch) -> None:
    """Tells its cameras with the intrinsics that it had at first."""
    first: list[Any] = []

    def answer(original: Any, self: Session, connection: Connection, request: Any, *a: Any) -> Any:
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


@mutant("VPT-5", check=EVERY_READER, code="no-init-packet")
def server_sees_no_other_height(patch: Patch) -> None:
    """Takes a size of the same width for the one that images have."""

    def set(original: Any, self: Viewport, asker: Connection, request: SetViewport) -> None:
        if self.exchange.memory.width == request.width:
            asker.send(ViewportSize(*request))
        else:
            original(self, asker, request)

    server.BEGINS_OTHER_SIZE.wrap(patch, set)


@mutant("POS-7", check="check_the_camera_stays_in_another_size", code="another-camera")
def server_begins_another_size_at_the_origin(patch: Patch) -> None:
    """Renders the first image of another size from where the server has begun."""
    begun = {1}

    def next_view(original: Any, self: Exchange, *arguments: Any) -> Any:
        view = original(self, *arguments)
        if view is None or view.generation in begun:
            return view
        begun.add(view.generation)
        return replace(view, poses=view.poses._replace(camera=IDENTITY))

    server.NEXT_VIEW.wrap(patch, next_view)


@mutant("CTL-5", check="check_scales_a_lens_that_waited", code="other-intrinsics")
def server_scales_lenses_by_the_height(patch: Patch) -> None:
    """Scales every lens as much across as down, whatever shape it is of."""

    def scaled(original: Any, lens: Any, width: int, height: int) -> Any:
        return original(lens, round(lens.width * height / lens.height), height)

    server.SCALES_LENS.wrap(patch, scaled)
