"""Mutants that store images wrongly, or at the wrong moment."""

import threading

import numpy as np
from splatbus_server.publish import Publisher
from splatbus_server.view import View

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant

LATE_SECONDS = 0.03


def stored(patch, channel, change):
    """Change what lies in a slot after it was written."""

    def write(original, self, image, color, depth):
        original(self, image, color, depth)
        slot = {"color": color, "depth": depth}[channel]
        if slot is not None:
            change(slot)

    Seam(Publisher, "write").wrap(patch, write)


@mutant("BUF-2", check="check_numbers_are_little_endian", code="big-endian", in_device_memory=True)
def server_stores_big_endian_numbers(patch):
    """Stores colours with their bytes in network order."""

    def swap(slot):
        slot[...] = slot.byteswap()

    stored(patch, "color", swap)


@mutant("BUF-2", check="check_colour_is_red_green_blue_alpha", code="another-order")
def server_stores_blue_first(patch):
    """Stores blue, green, red, alpha, as OpenCV's images are."""

    def swap(slot):
        slot[...] = slot[..., [2, 1, 0, 3]]

    stored(patch, "color", swap)


@mutant("BUF-3", check="check_colours_are_from_0_to_1", code="out-of-range", in_device_memory=True)
def server_does_not_clamp_colours(patch):
    """Stores what spherical harmonics gave, which may be more than 1."""

    def brighten(slot):
        slot[..., :3] *= 1.5

    stored(patch, "color", brighten)


@mutant("BUF-3", check="check_colours_are_from_0_to_1", code="out-of-range")
def server_stores_nan(patch):
    """Divides colour by alpha, and so 0 by 0 where nothing is."""

    def divide(slot):
        with np.errstate(invalid="ignore"):
            slot[..., :3] /= slot[..., 3:]

    stored(patch, "color", divide)


@mutant(
    "BUF-5", check="check_alpha_is_1_where_there_is_none", code="wrong-alpha", in_device_memory=True
)
def server_stores_no_alpha(patch):
    """Gives red, green and blue, and leaves alpha 0."""

    def clear(slot):
        slot[..., 3] = 0.0

    stored(patch, "color", clear)


def where_empty(change):
    """A change of the depths of empty pixels."""

    def fill(slot):
        slot[...] = np.where(np.isinf(slot), change(slot), slot)

    return fill


@mutant(
    "BUF-7",
    check="check_empty_pixels_are_infinitely_far",
    code="not-a-depth",
    in_device_memory=True,
)
def server_stores_depth_0_where_nothing_is(patch):
    """Clears its depth to 0."""
    stored(patch, "depth", where_empty(lambda slot: 0.0))


@mutant("BUF-7", check="check_empty_pixels_are_infinitely_far", code="wrong-empty-value")
def server_stores_its_far_plane(patch):
    """Clears its depth to a far plane of 1000, and announces +∞."""
    stored(patch, "depth", where_empty(lambda slot: 1000.0))


@mutant("ACC-9", check="check_transparent_pixels_are_empty", code="transparent-with-depth")
def server_keeps_depth_where_nothing_is(patch):
    """Divides depth by an alpha of nearly 0, and stores whatever that gives."""
    noise = np.random.default_rng(0)
    stored(patch, "depth", where_empty(lambda slot: noise.uniform(1.0, 9.0, slot.shape)))


@mutant(
    "IMG-4",
    check="check_what_is_lent_is_not_written",
    code="written-while-held",
    at=server.CHOOSES_SLOT,
)
def server_writes_to_slots_that_are_lent(original, self):
    """Writes to the slots in turn, whoever holds one."""
    newest = self.newest.slot if self.newest else -1
    self.writing = (newest + 1) % self.slots
    return self.writing


@mutant(
    "IMG-6",
    check="check_images_are_whole_when_they_are_lent",
    code="lent-unfinished",
    at=server.PUBLISHES,
)
def server_lends_before_it_has_written(original, self, view, moment, fill):
    """Lets a thread of its own write, and sends the frame meanwhile."""
    later = lambda *what: threading.Timer(LATE_SECONDS, fill, what).start()  # noqa: E731
    return original(self, view, moment, later)


@mutant("IMG-20", check="check_what_is_subscribed_to_is_written", code="other-pixels")
def server_lends_what_it_has(patch):
    """Lends images in which only what was wanted before is written."""
    server.LEASES_NEWEST.wrap(
        patch,
        lambda original, self, client, memory, wants: original(self, client, memory, frozenset()),
    )


@mutant("IMG-20", check="check_what_is_subscribed_to_is_written", code="other-pixels")
def server_writes_what_was_said_last(patch):
    """Writes what its readers want when it renders, and not what they wanted when they waited."""
    server.NEEDS_OF_READER.replace(patch, property(lambda self: self.wants))


@mutant(
    "IMG-5", check="check_every_slot_shows_the_same", code="other-pixels", at=server.WRITES_IMAGE
)
def server_swaps_colours_in_its_fourth_slot(original, self, *image):
    """Stores blue for red in a slot that is used where two readers hold images."""
    write = original(self, *image)

    def written(slot, wants):
        write(slot, wants)
        if slot == 3 and "color" in wants:
            self.color(slot)[..., :3] = self.color(slot)[..., 2::-1].copy()

    return written


@mutant("BUF-6", check="check_depth_is_planar", code="no-depth")
def server_stores_no_depth(patch):
    """Renders depth when nobody wants it, and leaves the slots empty otherwise."""
    Seam(View, "wants_depth").replace(patch, property(lambda self: "depth" not in self.wants))


@mutant("IMG-5", check="check_every_pixel_is_of_the_camera", code="other-depths")
def server_tells_other_depths_in_a_corner(patch):
    """Stores depths in a quarter of the image that are a tenth too large."""

    def scale(slot):
        slot[: len(slot) // 2, : slot.shape[1] // 2] *= 1.1

    stored(patch, "depth", scale)
