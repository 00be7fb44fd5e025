"""How the chapters of 1.0 and 1.1 become one standard: what stands where, and what reads otherwise.

A sentence of a chapter named here goes where its section goes; a chapter that is not named comes
last. So nothing here need change for a new sentence, nor anything be lost for want of a change.
"""

from __future__ import annotations

import re

CHAPTERS = (
    ("editions/parts/client.md",),
    ("editions/parts/server.md",),
    ("1.0/README.md", "1.1/README.md"),
    ("1.0/02-framing.md",),
    ("1.0/03-channels.md",),
    ("1.1/02-negotiation.md",),
    ("1.0/04-init-packet.md", "1.1/03-init-packet.md"),
    ("1.1/04-opening.md",),
    ("1.0/05-buffers.md", "1.1/05-frames.md"),
    ("1.0/06-messages.md", "1.1/06-cameras.md"),
    ("1.1/07-objects.md",),
    ("1.1/08-viewport.md",),
    ("1.1/09-time.md",),
    ("1.0/07-conventions.md",),
    ("1.0/08-accuracy.md",),
    ("1.0/09-limits-security.md",),
    ("1.1/10-evolution.md",),
    ("1.1/annex-a-telemetry.md",),
    ("1.1/annex-b-compatibility.md",),
    ("1.0/10-interoperability.md",),
)
"""The files that make each chapter. All but the first are sections of it."""

TITLES = {
    "1.0/README.md": "Introduction",
    "1.1/README.md": "Versions",
    "1.1/03-init-packet.md": "Version, memory, ring and semantics",
    "1.0/05-buffers.md": "Images",
    "1.1/05-frames.md": "Whole images: `frame` and `release`",
    "1.0/06-messages.md": "Poses, requests and control",
    "1.1/06-cameras.md": "Tags, lenses, control",
    "1.1/annex-b-compatibility.md": "Who works with whom",
    "1.0/10-interoperability.md": "Interoperability notes (informative)",
}
"""What a file is called here, where its own title would tell of another document."""

CONTINUES = {"1.1 1.2": "1.0 1.2", "1.1 1.4": "1.0 9.1"}
"""Sections that say more of what an earlier one begins, and stand in it."""

LEFT_OUT = {
    "client": (
        *("1.0 3.4", "1.1 2.7", "1.1 2.8", "1.1 4.1", "1.1 6.4", "1.1 10", "1.1 10."),
        *("1.0 1", "1.0 1.3", "1.0 3", "1.0 7.3", "1.0 7.4", "1.0 9.1", "1.0 9.2"),
        *("1.0 10", "1.0 10.", "1.1 1.4", "1.1 B", "1.1 B."),
    ),
    "server": ("1.0 1", "1.0 1.3", "1.0 3", "1.0 10", "1.0 10.", "1.1 B.2", "1.1 B.3"),
    "": ("1.1 B.3",),
}
"""Sections, and beginnings of chapters, whose explanations a reader does not need: no sentence is
left out. A dot at the end stands for all sections of a chapter. The states of connections and of
what they share are in the first chapter of a client's edition, all of them."""

CUDA_SECTIONS = ("1.0 5.4", "1.0 5.5")
CUDA_BLOCK = re.compile(
    r"`cuda_ipc`|example=(?:\w+_cuda|init_packet)$|^With CUDA memory the", re.MULTILINE
)
"""What a client needs for memory on a GPU alone: an annex of its edition."""

_PACKETS = "its packet is in [`packets.json`](../vectors/packets.json)."
REWORDED = (
    (re.compile(r"To those of 1\.0 \(section [\d.]+ there\) 1\.1 adds:"), "Besides:"),
    (re.compile(r" Everything that chapter \d+ of 1\.0 says of poses holds here too\."), ""),
    (
        re.compile(r"A server that speaks 1\.1 adds members to the init packet\. .+"),
        "The init packet of a server that speaks 1.1 has more members:",
    ),
    (re.compile(r"A peer conforms to 1\.0 when"), "A peer conforms when"),
    (re.compile(r"Words added to those of 1\.0: "), "More words: "),
    (re.compile(r"Every hexadecimal example .+; every (JSON .+)\."), rf"Every \1; {_PACKETS}"),
    (
        re.compile(r"[Cc]hapters \d+ to \d+ speak (.+), they mean"),
        r"this document speaks \1, it means",
    ),
    (re.compile(r"(`error`s by) (\d+\.\d+)"), r"\1 section \2"),
    (
        re.compile(r"is about (\d+\.\d+), (.+) about (\d+\.\d+)\."),
        r"is about section \1, \2 about section \3.",
    ),
)
"""Phrases that tell of two documents."""

REWORDED_FOR_ONE = (
    (re.compile(r"^> > Binds: [^.]+\. (Acceptable: .+)\n> > Why: …", re.M), r"> > \1"),
    (re.compile(r"\*Binds\* names the peers that must satisfy it\. "), ""),
    (re.compile(r"\*Why\* is informative, as is all other text"), "All other text is informative"),
    (re.compile(r"^> Binds: [^.]+\.(?:\n|$)|(?<=> )Binds: [^.]+\. |^> Why: .+\n?", re.M), ""),
)
"""What an edition for one reader says otherwise: whom a sentence binds is known, and why is told in
the complete one."""

NOT_HERE = re.compile(
    r"\*\*Status: |## Contents$|\| chapter \| ids \||The packet: \[|```hex (?!example=get_viewport)"
)
"""How blocks begin that a document of its own has not: other documents' state, contents, dumps."""

OTHERS = {
    "client": re.compile(
        r"(?:A|An|The|Two|Every|No) (?:server|renderer)s?\b(?![\s\S]*\b[Cc]lient)"
        r"|The usual 1 −|Turning Gaussians|Cameras far from the origin"
        r"|A pose (?:that arrives|crosses)|Where the name of its host|To say nothing is no offence"
        r"|A client that breaks OPN-11|The quaternions q and"
        r"|Control passes on|No `error` is sent there"
        r"|A connection that is sent no init packet|The value that there was"
        r"|For the pixel in the top-left corner"
        r"|How depth and alpha follow|Which pixels are covered|\| what happens \||Vectors for"
        r"|\| \| t₀|A restart, as the client"
        r"|```\n +client +server\n +\|(?:=|<--- end)|Each client holds"
    ),
    "server": re.compile(
        r"(?:A|An|The|Two|Every|No) (?:client|viewer)s?\b(?![\s\S]*\b[Ss]erver)|It may ask as often"
    ),
}
"""How blocks begin that explain to the other peer alone, or what the reader's part tells, too."""

NOTES_FOR_OTHERS = {"client": re.compile(r"> In 1\.1 \((?:a server may|every client is served)")}
"""How notes begin on what only the other peer may do, of sentences that bind both or are quoted."""

CUDA_TITLE = "Memory on a GPU (CUDA)"
HEADS = {
    "client": """\
# SplatBus protocol 1.1: the client's edition

All that the author of a client needs. Made by `python -m splatbus_schemas.prose --write`.""",
    "server": """\
# SplatBus protocol 1.1: the server's edition

All that the author of a server needs. Made by `python -m splatbus_schemas.prose --write`.""",
    "": """\
# SplatBus protocol 1.1, complete

All of the standard. Made by `python -m splatbus_schemas.prose --write`.""",
}
"""How each edition begins."""
