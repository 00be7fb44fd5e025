"""Mutants that only an adapter shows: what they read and show is wrong."""

import time
from typing import Any

import numpy as np
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.lease import FrameLease
from splatbus_client.reading import Reading
from splatbus_viewer import display
from splatbus_viewer.mirror import Copied, Mirror
from splatbus_wire.compositing import over_straight

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, viewer
from tests.zoo.mutant import mutant

SEMANTICS = "check_shows_images_by_their_semantics"

# Images


def _whatever_happened(patch: Patch) -> None:
    Seam(FrameLease, "intact").replace(patch, property(lambda self: True))


@mutant(
    "IMG-13",
    check="check_releases_when_it_has_read",
    code="released-too-early",
    axes="opencv",
)
def releases_before_it_reads(patch: Patch) -> None:
    """Gives an image back as soon as it has it, and copies it a moment later."""

    def copied(original: Any, lease: FrameLease) -> Copied:
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
)
def keeps_no_copy(patch: Patch) -> None:
    """Shows what lies in the slot now, whether or not it is lent."""

    def copied(original: Any, lease: FrameLease) -> Copied:
        return Copied(lease.seq, lease.color, lease.depth, lease.camera, lease.semantics)

    viewer.COPIES_IMAGE.wrap(patch, copied)


@mutant(
    "IMG-22",
    check="check_reads_only_what_it_subscribed_to",
    code="read-unsubscribed",
    axes="opencv",
)
def reads_both_channels_always(patch: Patch) -> None:
    """Subscribes to one channel, and reads both."""

    def lend(original: Any, self: Reading, frame: Any, channels: Any) -> None:
        original(self, frame, frozenset(("color", "depth")))

    client.IS_LENT_FRAME.wrap(patch, lend)


@mutant(
    "IMG-22",
    check="check_reads_only_what_it_subscribed_to",
    code="read-unsubscribed",
    axes="opencv",
)
def reads_at_once_what_it_subscribes_to(patch: Patch) -> None:
    """Reads a channel of the next image that comes, which may have crossed its `subscribe`."""

    def subscribe(original: Any, self: IpcProtocol, channels: Any) -> None:
        original(self, channels)
        self.written = channels

    Seam(IpcProtocol, "subscribe").wrap(patch, subscribe)


@mutant(
    "CHN-18",
    check="check_leaves_the_buffers_when_the_connection_ends",
    code="read-after-end",
    axes="opencv",
)
def reads_on_without_a_connection(patch: Patch) -> None:
    """Shows the memory of the slot that it read last while it is not connected."""
    views: list[Any] = []

    def copied(original: Any, lease: FrameLease) -> Any:
        views[:] = [lease.color, lease.depth]
        return original(lease)

    def newest(self: Mirror) -> Any:
        if self.kept is None or self.session.status.ipc.connected:  # type: ignore[attr-defined]
            return self.kept  # type: ignore[attr-defined]
        return self.kept._replace(color=views[0], depth=views[1])  # type: ignore[attr-defined]

    def keep(self: Mirror, image: Any) -> None:
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
def forgets_that_rows_are_bottom_up(patch: Patch) -> None:
    """Shows the first row of the memory at the top."""
    for seam in (client.COLOR_OF_SLOT, client.DEPTH_OF_SLOT):
        seam.wrap(patch, lambda original, self, slot: original(self, slot)[::-1])


@mutant("MEM-13", check=SEMANTICS, code="another-alpha", axes="opencv")
def blends_premultiplied_as_straight(patch: Patch) -> None:
    """Multiplies colour by alpha once more."""
    Seam(display, "over_premultiplied").replace(patch, over_straight)


def _meant(patch: Patch, **otherwise: Any) -> None:
    def planar(original: Any, color: Any, depth: Any, camera: Any, semantics: Any) -> Any:
        return original(color, depth, camera, semantics._replace(**otherwise))

    viewer.PLANAR_DEPTH.wrap(patch, planar)


@mutant("MEM-13", check=SEMANTICS, code="another-depth-kind", axes="opencv")
def takes_distances_for_depths(patch: Patch) -> None:
    """Compares the distance along the ray with the depth of its own geometry."""
    _meant(patch, depth_kind="planar_z")


@mutant("MEM-13", check=SEMANTICS, code="empty-value-ignored", axes="opencv")
def knows_one_empty_depth(patch: Patch) -> None:
    """Takes only infinity for empty."""
    _meant(patch, depth_empty=float("inf"))


@mutant("MEM-13", check=SEMANTICS, code="empty-value-ignored", axes="opencv")
def compares_empty_depths_in_double(patch: Patch) -> None:
    """Finds no empty pixel where no single is the number that was announced."""

    def planar(original: Any, color: Any, depth: Any, camera: Any, semantics: Any) -> Any:
        exact = float(np.float32(semantics.depth_empty)) == semantics.depth_empty
        meant = semantics if exact else semantics._replace(depth_empty=float("inf"))
        return original(color, depth, camera, meant)

    viewer.PLANAR_DEPTH.wrap(patch, planar)


@mutant(
    "BUF-8",
    check="check_shows_its_geometry_where_the_image_is_empty",
    code="empty-pixel-shown",
    axes="opencv",
)
def draws_empty_pixels_in_front(patch: Patch) -> None:
    """Takes an infinite depth for none at all, and draws the pixel before everything."""

    def planar(original: Any, color: Any, depth: Any, *rest: Any) -> Any:
        return np.where(np.isposinf(depth), np.float32(0.01), original(color, depth, *rest))

    viewer.PLANAR_DEPTH.wrap(patch, planar)


@mutant(
    "BUF-9",
    check="check_takes_no_odd_depth_for_a_surface",
    code="odd-depth-shown",
    axes="opencv",
)
def takes_negative_depths(patch: Patch) -> None:
    """Takes every depth that is less than that of its own geometry for a surface."""

    def planar(original: Any, color: Any, depth: Any, *rest: Any) -> Any:
        return original(color, np.where(depth < 0, np.float32(0.01), depth), *rest)

    viewer.PLANAR_DEPTH.wrap(patch, planar)


@mutant("ACC-10", check="check_composes_within_three_ulp", code="beyond-its-budget", axes="opencv")
def composes_in_eight_bits(patch: Patch) -> None:
    """Truncates the image to eight bits a channel before it blends it."""

    def composed(original: Any, color: Any, *rest: Any) -> Any:
        return original((np.floor(color * 255) / np.float32(255)).astype(np.float32), *rest)

    viewer.COMPOSES.wrap(patch, composed)
