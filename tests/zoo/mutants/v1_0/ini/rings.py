"""Mutants that find images in the wrong place, or show them by what was said before."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_client.events import Lent
from splatbus_client.ipc_protocol import CHANNELS

from tests.zoo.faults.seams import client, viewer, wire
from tests.zoo.mutant import mutant

ANY_RING = "check_shows_what_any_ring_holds"


@mutant(
    "CHN-24",
    check="check_shows_the_memory_of_the_new_connection",
    code="other-pixels",
    axes="opencv",
)
def keeps_memory_of_the_same_size(patch):
    """Does not map memory that is as large as what it has mapped and has the same generation."""
    mapped: dict[tuple[int, int], Any] = {}

    def once(original, memory, packet):
        kind = memory.bytes, packet.generation
        if kind not in mapped:
            mapped[kind] = original(memory, packet)
        return mapped[kind]

    client.MAPS_MEMORY.wrap(patch, once)
    client.UNMAPS_MEMORY.replace(patch, lambda self: True)


@mutant(
    "INI-10",
    check="check_reads_where_32_bits_do_not_reach",
    code="other-place",
    axes="opencv",
    at=client.COLOR_OF_SLOT,
)
def has_32_bits_for_an_offset(original, self, slot):
    """Cuts the offset of the colour of a slot to 32 bits."""
    begin = self.ring.color_offset + slot * self.ring.color_stride
    cut = self.ring._replace(color_offset=begin & 0xFFFFFFFF, color_stride=0)
    whole, self.ring = self.ring, cut
    try:
        return original(self, slot)
    finally:
        self.ring = whole


@mutant("INI-8", check=ANY_RING, code="other-pixels", axes="opencv")
def rounds_the_rows_of_depth_up(patch):
    """Takes rows of depth to begin at multiples of 16 bytes, as textures have them."""

    def depth(self, slot):
        width, height = self.size
        pitch = -(-4 * width // 16) * 16
        begin = self.ring.depth_offset + slot * self.ring.depth_stride
        data = bytes(self.map[begin : begin + pitch * height]).ljust(pitch * height, b"\0")
        rows = np.frombuffer(data, np.float32).reshape(height, pitch // 4)
        return rows[::-1, :width]

    client.DEPTH_OF_SLOT.replace(patch, depth)


@mutant("INI-8", check=ANY_RING, code="other-pixels", axes="opencv", at=client.COLOR_OF_SLOT)
def reads_pairs_of_columns(original, self, slot):
    """Copies two pixels at a time, and repeats the last but one of an odd row."""
    pixels: NDArray[np.float32] = np.array(original(self, slot))
    if pixels.shape[1] > 1 and pixels.shape[1] % 2:
        pixels[:, -1] = pixels[:, -2]
    return pixels


@mutant(
    "INI-8", check="check_accepts_good_init_packets", code="not-opened", at=wire.READS_INIT_PACKET
)
def adds_the_offsets_of_1_0(original, message):
    """Adds `meta.offsetColor`, which has no meaning in a ring, to where its colour begins."""
    if "ring" in message:
        begin = message["ring"]["colorOffset"] + message["meta"].get("offsetColor", 0)
        message = message | {"ring": message["ring"] | {"colorOffset": begin}}
    return original(message)


@mutant(
    "MEM-13",
    check="check_shows_images_by_their_semantics",
    code="other-colours",
    axes="opencv",
)
def keeps_the_lens_of_the_first_image(patch):
    """Computes the directions of rays once for each size of images."""
    known: dict[tuple[int, int], Any] = {}

    def rays(original, camera):
        return known.setdefault((camera.width, camera.height), original(camera))

    viewer.RAYS_OF_PIXELS.wrap(patch, rays)


def _composed(patch, change):
    """Change what is shown of an image over geometry, given the image and what lies behind it."""

    def composed(original, *given):
        return change(original(*given), *given)

    viewer.COMPOSES.wrap(patch, composed)


@mutant(
    "BUF-8",
    check="check_shows_its_geometry_where_the_image_is_empty",
    code="empty-pixel-shown",
    axes="opencv",
)
def makes_nan_of_empty_pixels(patch):
    """Multiplies what is shown by a quotient of depths, which is NaN where both are infinite."""

    def spoil(seen, color, depth, _, __, mesh, far):
        both = np.isinf(depth) & np.isinf(far)
        return np.where(both[..., None], np.float32(np.nan), seen)

    _composed(patch, spoil)


@mutant(
    "CHN-18",
    check="check_leaves_the_buffers_when_the_connection_ends",
    code="read-after-end",
    through="IMG-22",
    axes="opencv",
)
def shows_the_colour_of_lost_memory(patch):
    """Shows the colour that lies in the slot that it read last while it is not connected."""
    views: list[Any] = []

    def color(original, self, slot):
        views[:] = [original(self, slot)]
        return views[0]

    def newest(self):
        kept = self.__dict__.get("kept")
        if kept is None or kept.color is None or self.session.status.ipc.connected:
            return kept
        return kept._replace(color=views[0])

    def keep(self, image):
        self.__dict__["kept"] = image

    client.COLOR_OF_SLOT.wrap(patch, color)
    viewer.NEWEST_IMAGE.replace(patch, property(newest, keep))


@mutant(
    "IMG-22",
    check="check_reads_only_what_it_subscribed_to",
    code="read-unsubscribed",
    axes="opencv",
    at=client.TAKES_FRAME,
)
def reads_the_first_image_of_a_connection_whole(original, self, frame):
    """Subscribes again when it has come back, and reads both channels of the first image."""
    first = "has_read" not in self.__dict__
    self.__dict__["has_read"] = True
    for event in original(self, frame):
        whole = first and isinstance(event, Lent)
        yield event._replace(channels=CHANNELS) if whole else event


@mutant(
    "IMG-12", check="check_releases_each_frame_once", code="not-released", at=client.TAKES_FRAME
)
def keeps_images_from_before_time_0(original, self, frame):
    """Takes a frame whose time is negative for none."""
    if frame.time >= 0:
        yield from original(self, frame)
