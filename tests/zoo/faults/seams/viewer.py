"""What shows images, and what an adapter says of them."""

from splatbus_viewer import adapter, display, mirror
from splatbus_viewer.mirror import Mirror

from tests.zoo.faults.seam import Seam

COMPOSES = Seam(adapter, "composed")
PLANAR_DEPTH = Seam(display, "planar_depth")
RAYS_OF_PIXELS = Seam(display, "rays")
COPIES_IMAGE = Seam(mirror, "copy_of")
READS_FRAME = Seam(Mirror, "read")
NEWEST_IMAGE = Seam(Mirror, "newest")
