"""What a job fetches from others is what was looked at: actions are named by their commit."""

import re

from tests.package.building import ROOT, tracked

USES = re.compile(r"^\s*(?:- )?uses: *(\S+)(.*)$", re.MULTILINE)
PINNED = re.compile(r"[\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+(\.\d+)*")
OURS = "OWNER/splatbus-protocol@"
"""A name to be filled in."""


def test_each_action_of_others_is_pinned_with_its_release_beside_it() -> None:
    used = [
        (name, *found)
        for name in tracked()
        if name.endswith((".yml", ".yaml", ".md"))
        for found in USES.findall((ROOT / name).read_text("utf-8"))
    ]
    assert {name for name, *_ in used} >= {"action.yml", "conformance/guides/in-ci.md"}
    others = [it for it in used if not it[1].startswith(("./", OURS))]
    assert [it for it in others if not PINNED.fullmatch(f"{it[1]}{it[2]}")] == []
