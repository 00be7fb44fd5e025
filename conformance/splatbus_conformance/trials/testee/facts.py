"""What a first meeting shows of a testee on either side."""

from dataclasses import dataclass, field

from splatbus_conformance.images.memory.device import why_no_device


@dataclass(kw_only=True)
class Facts:
    """Where its images may lie, and what is said to its author."""

    device: str = ""
    """Where its device memory, or that for it, lies: a GPU, or the stand-in; nothing if there is
    none."""
    device_unseen: str | None = "only the stand-in CUDA runtime could show it: --stand-in-cuda"
    """Why nothing is seen of what it does with device memory; None if it is seen."""
    advice: list[str] = field(default_factory=list)
    """What the meeting suggests to its author, or to who started it."""

    def device_lacks(self, kind: str) -> str | None:
        """Why a check that needs a `device` or the `stand-in` can show nothing; None if it can."""
        unseen = self.device_unseen
        return unseen if kind == "stand-in" else why_no_device(self.device, unseen)
