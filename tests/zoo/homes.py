"""Where specimens live: what those of a module have in common is here, and not in their names."""

from dataclasses import dataclass
from enum import StrEnum

from splatbus_conformance.plan import Side


class Judge(StrEnum):
    """Who has to find out what is broken."""

    HARNESS = "the harness"
    WITH_CUDA = "the harness, with images in memory of a GPU"
    """Here the stand-in's."""
    SIMULATION = "the simulation"
    """By an invariant, in some session."""


@dataclass(frozen=True)
class Home:
    """What specimens have in common."""

    side: Side
    judge: Judge = Judge.HARNESS
    axes: str = ""
    """Of the engine whose client each plays, beside its adapter, if it does not say another."""


HOMES = {
    f"{__package__}.{module}": home
    for home, modules in {
        Home("client"): (
            "mutants.stateful.clients",
            "mutants.v1_0.chn.clients",
            "mutants.v1_0.chn.pacing",
            "mutants.v1_0.cnv.adapter",
            "mutants.v1_0.frm.both",
            "mutants.v1_0.frm.clients",
            "mutants.v1_0.ini.clients",
            "mutants.v1_0.ini.rings",
            "mutants.v1_0.jsn.clients",
            "mutants.v1_0.jsn.irregular",
            "mutants.v1_0.jsn.reading",
            "mutants.v1_0.pos.clients",
            "mutants.v1_0.req.clients",
            "mutants.v1_1.ctl_clients",
            "mutants.v1_1.evo",
            "mutants.v1_1.img.clients",
            "mutants.v1_1.img.clients_shown",
            "mutants.v1_1.img.guesses",
            "mutants.v1_1.img.told",
            "mutants.v1_1.mem.clients",
            "mutants.v1_1.neg.clients",
            "mutants.v1_1.neg.granted",
            "mutants.v1_1.opn.clients",
            "variations.client",
            "variations.client_adapted",
            "variations.client_channels",
            "variations.client_memory",
            "variations.client_together",
        ),
        Home("server"): (
            "mutants.stateful.servers",
            "mutants.v1_0.acc",
            "mutants.v1_0.buf",
            "mutants.v1_0.chn.servers",
            "mutants.v1_0.cnv.servers",
            "mutants.v1_0.frm.servers",
            "mutants.v1_0.ini.servers",
            "mutants.v1_0.jsn.servers",
            "mutants.v1_0.lim_sec",
            "mutants.v1_0.pos.servers",
            "mutants.v1_0.req.servers",
            "mutants.v1_1.cam.lenses",
            "mutants.v1_1.cam.resized",
            "mutants.v1_1.cam.tags",
            "mutants.v1_1.ctl",
            "mutants.v1_1.evo_servers",
            "mutants.v1_1.img.leases",
            "mutants.v1_1.img.servers",
            "mutants.v1_1.mem.servers",
            "mutants.v1_1.neg.afterwards",
            "mutants.v1_1.neg.errors",
            "mutants.v1_1.neg.order",
            "mutants.v1_1.neg.servers",
            "mutants.v1_1.neg.tokens",
            "mutants.v1_1.neg.wording",
            "mutants.v1_1.obj_scn",
            "mutants.v1_1.opn.servers",
            "mutants.v1_1.tim_png_tel",
            "mutants.v1_1.vpt",
            "variations.server",
            "variations.server_1_1",
            "variations.server_blobs",
            "variations.server_images",
            "variations.server_messages",
            "variations.server_together",
            "variations.server_unhurried",
        ),
        Home("client", Judge.WITH_CUDA, "opencv"): (
            "mutants.device.buffers",
            "mutants.device.frames",
            "mutants.device.packets",
            "mutants.device.shown",
            "variations.client_cuda",
        ),
        Home("server", Judge.WITH_CUDA): (
            "mutants.device.servers",
            "variations.server_device",
        ),
        Home("client", Judge.SIMULATION): ("mutants.simulated.clients",),
        Home("server", Judge.SIMULATION): ("mutants.simulated.servers",),
    }.items()
    for module in modules
}
"""Of each module in which specimens are declared."""
