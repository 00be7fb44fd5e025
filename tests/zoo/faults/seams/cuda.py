"""The client's images in memory of a GPU: the buffers of 1.0, and the ring."""

from splatbus_client.cuda import legacy
from splatbus_client.cuda.images import CudaImages
from splatbus_client.cuda.legacy import LegacyImages

from tests.zoo.faults.seam import Seam

BEGINS_WITH_RING = Seam(CudaImages, "__init__")
BEGINS_WITH_BUFFERS = Seam(LegacyImages, "__init__")
OPENS_BUFFER = Seam(legacy, "opened_memory")
"""Colour's and depth's, which may be in one allocation."""
DEVICE_BY_NUMBER = Seam(legacy, "numbered")
"""Of the buffers."""
