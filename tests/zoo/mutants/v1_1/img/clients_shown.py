"""Mutants that only an adapter shows: what they read and show is wrong."""

import time
from typing import Any

import numpy as np
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.lease import FrameLease
from splatbus_viewer import display
from splatbus_viewer.mirror import Copied
from splatbus_wire.compositing import over_straight

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, viewer
from tests.zoo.mutant import mutant

SEMANTICS = "check_shows_images_by_their_semantics"

# Images


def _whatever_happened(patch):
    Seam(FrameLease, "intact").replace(patch, property(lambda self: True))


@mutant(
    "IMG-13",
    check="check_releases_when_it_has_read",
    code="released-too-early",
    axes="opencv",
)
def releases_before_it_reads(patch):
    """Gives an image back as soon as it has it, and copies it a moment later."""

    def copied(original, lease):
        color, depth, kept = lease.color, lease.depth, (lease.seq, lease.camera, lease.semantics)
        lease.release()
        time.sleep(0.02)
        return Copied(kept[0], np.array(color), np.array(depth), *kept[1:])

    _whatever_happened(patch)
    viewer.COPIES_IMAGE.wrap(patch, copied)


@mutant(
    "IMG-14",
    check="check_reads_only_what_it_holds",
    code="read-without-lease",
    axes="opencv",
    at=viewer.COPIES_IMAGE,
)
def keeps_no_copy(original, lease):
    """Shows what lies in the slot now, whether or not it is lent."""
    return Copied(lease.seq, lease.color, lease.depth, lease.camera, lease.semantics)


@mutant(
    "IMG-22",
    check="check_reads_only_what_it_subscribed_to",
    code="read-unsubscribed",
    axes="opencv",
    at=client.IS_LENT_FRAME,
)
def reads_both_channels_always(original, self, frame, channels):
    """Subscribes to one channel, and reads both."""
    original(self, frame, frozenset(("color", "depth")))


@mutant(
    "IMG-22",
    check="check_reads_only_what_it_subscribed_to",
    code="read-unsubscribed",
    axes="opencv",
    at=Seam(IpcProtocol, "subscribe"),
)
def reads_at_once_what_it_subscribes_to(original, self, channels):
    """Reads a channel of the next image that comes, which may have crossed its `subscribe`."""
    original(self, channels)
    self.written = channels


@mutant(
    "CHN-18",
    check="check_leaves_the_buffers_when_the_connection_ends",
    code="read-after-end",
    axes="opencv",
)
def reads_on_without_a_connection(patch):
    """Shows the memory of the slot that it read last while it is not connected."""
    views: list[Any] = []

    def copied(original, lease):
        views[:] = [lease.color, lease.depth]
        return original(lease)

    def newest(self):
        if self.kept is None or self.session.status.ipc.connected:  # type: ignore[attr-defined]
            return self.kept  # type: ignore[attr-defined]
        return self.kept._replace(color=views[0], depth=views[1])  # type: ignore[attr-defined]

    def keep(self, image):
        self.kept = image  # type: ignore[attr-defined]

    viewer.COPIES_IMAGE.wrap(patch, copied)
    viewer.NEWEST_IMAGE.replace(patch, property(newest, keep))


# What is shown


@mutant(
    "MEM-13",
    check="check_shows_rows_from_the_bottom_up",
    code="rows-top-down",
    axes="opencv",
)
def forgets_that_rows_are_bottom_up(patch):
    """Shows the first row of the memory at the top."""
    for seam in (client.COLOR_OF_SLOT, client.DEPTH_OF_SLOT):
        seam.wrap(patch, lambda original, self, slot: original(self, slot)[::-1])


@mutant("MEM-13", check=SEMANTICS, code="another-alpha", axes="opencv")
def blends_premultiplied_as_straight(patch):
    """Multiplies colour by alpha once more."""
    Seam(display, "over_premultiplied").replace(patch, over_straight)


def _meant(patch, **otherwise):
    def planar(original, color, depth, camera, semantics):
        return original(color, depth, camera, semantics._replace(**otherwise))

    viewer.PLANAR_DEPTH.wrap(patch, planar)


@mutant("MEM-13", check=SEMANTICS, code="another-depth-kind", axes="opencv")
def takes_distances_for_depths(patch):
    """Compares the distance along the ray with the depth of its own geometry."""
    _meant(patch, depth_kind="planar_z")


@mutant("MEM-13", check=SEMANTICS, code="empty-value-ignored", axes="opencv")
def knows_one_empty_depth(patch):
    """Takes only infinity for empty."""
    _meant(patch, depth_empty=float("inf"))


@mutant(
    "MEM-13", check=SEMANTICS, code="empty-value-ignored", axes="opencv", at=viewer.PLANAR_DEPTH
)
def compares_empty_depths_in_double(original, color, depth, camera, semantics):
    """Finds no empty pixel where no single is the number that was announced."""
    exact = float(np.float32(semantics.depth_empty)) == semantics.depth_empty
    meant = semantics if exact else semantics._replace(depth_empty=float("inf"))
    return original(color, depth, camera, meant)


@mutant(
    "BUF-8",
    check="check_shows_its_geometry_where_the_image_is_empty",
    code="empty-pixel-shown",
    axes="opencv",
    at=viewer.PLANAR_DEPTH,
)
def draws_empty_pixels_in_front(original, color, depth, *rest):
    """Takes an infinite depth for none at all, and draws the pixel before everything."""
    return np.where(np.isposinf(depth), np.float32(0.01), original(color, depth, *rest))


@mutant(
    "BUF-8",
    check="check_shows_its_geometry_where_the_image_is_empty",
    code="transparent-pixel-shown",
    axes="opencv",
)
def draws_transparent_pixels(patch):
    """Takes an alpha of 0 for one that is not given, and draws the pixel opaque."""

    def opaque(original, color, *rest):
        alpha = np.where(color[..., 3:] == 0, np.float32(1), color[..., 3:])
        return original(np.concatenate([color[..., :3], alpha], -1), *rest)

    for seam in (viewer.PLANAR_DEPTH, Seam(display, "over_straight")):
        seam.wrap(patch, opaque)


@mutant(
    "BUF-9",
    check="check_takes_no_odd_depth_for_a_surface",
    code="odd-depth-shown",
    axes="opencv",
    at=viewer.PLANAR_DEPTH,
)
def takes_negative_depths(original, color, depth, *rest):
    """Takes every depth that is less than that of its own geometry for a surface."""
    return original(color, np.where(depth < 0, np.float32(0.01), depth), *rest)


@mutant(
    "ACC-10",
    check="check_composes_within_three_ulp",
    code="beyond-its-budget",
    axes="opencv",
    at=viewer.COMPOSES,
)
def composes_in_eight_bits(original, color, *rest):
    """Truncates the image to eight bits a channel before it blends it."""
    return original((np.floor(color * 255) / np.float32(255)).astype(np.float32), *rest)
