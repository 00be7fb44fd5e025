import json
from pathlib import Path

import pytest
from splatbus_schemas import prose

ONE = """\
**[FRM-3]** A receiver MUST close it.

> Binds: client, server. Acceptable: closes, ignores.
> Why: nothing that follows can be trusted.
"""


def chapter(root: Path, text: str, version: str = "1.0", name: str = "02-framing.md") -> None:
    folder = root / "spec" / version
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "README.md").write_text("**Status: draft 3.** So far.\n", "utf-8")
    (folder / name).write_text(text, "utf-8")


def test_a_requirement_is_read_whole() -> None:
    assert list(prose.requirements_in("# Head\n\n" + ONE + "\nMore text.\n", "here.md")) == [
        {
            "id": "FRM-3",
            "level": "MUST",
            "binds": ["client", "server"],
            "acceptable": ["closes", "ignores"],
            "sentence": "A receiver MUST close it.",
            "why": "nothing that follows can be trusted.",
            "chapter": "here.md",
        }
    ]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("> Binds: client, server. Acceptable: closes, ignores.\n", ""),
        ("\n\n> Binds", "\n> Binds"),
        ("Binds: client, server", "Binds: everybody"),
        ("MUST close", "closes"),
        ("MUST close it", "MUST close it and SHOULD say so"),
        ("[FRM-3]", "[FRAME-3]"),
        ("Acceptable: closes", "Acceptable: [closes]"),
    ],
)
def test_a_malformed_requirement_is_an_error(before: str, after: str) -> None:
    assert before in ONE
    with pytest.raises(prose.ProseError, match=r"here\.md"):
        list(prose.requirements_in(ONE.replace(before, after), "here.md"))


@pytest.mark.parametrize("level", prose.LEVELS)
def test_each_level_is_told_from_the_others(level: str) -> None:
    (found,) = prose.requirements_in(ONE.replace("MUST", level), "here.md")
    assert found["level"] == level


def test_a_registry_holds_the_chapters_in_order(tmp_path: Path) -> None:
    chapter(tmp_path, ONE.replace("FRM-3", "CHN-1"), name="03-channels.md")
    chapter(tmp_path, ONE)
    found = prose.collect("1.0", tmp_path)
    assert [each["id"] for each in found["requirements"]] == ["FRM-3", "CHN-1"]
    assert found["requirements"][0]["chapter"] == "spec/1.0/02-framing.md"
    assert json.loads(prose.rendered_registry("1.0", tmp_path)) == found


def test_a_registry_says_how_far_its_text_has_come(tmp_path: Path) -> None:
    chapter(tmp_path, ONE)
    assert prose.collect("1.0", tmp_path)["status"] == "draft 3"
    chapter(tmp_path, "Nothing yet.", name="README.md")
    with pytest.raises(prose.ProseError, match="status"):
        prose.collect("1.0", tmp_path)


def test_an_id_that_stands_twice_is_an_error(tmp_path: Path) -> None:
    chapter(tmp_path, ONE)
    chapter(tmp_path, ONE, name="03-channels.md")
    with pytest.raises(prose.ProseError, match="FRM-3 stands twice"):
        prose.collect("1.0", tmp_path)


def test_an_outcome_is_known_from_its_version_on(tmp_path: Path) -> None:
    declines = ONE.replace("closes, ignores", "declines")
    chapter(tmp_path, declines)
    chapter(tmp_path, declines, version="1.1")
    with pytest.raises(prose.ProseError, match="declines"):
        prose.collect("1.0", tmp_path)
    assert len(prose.collect("1.1", tmp_path)["requirements"]) == 1


EXAMPLE = '```json example=hi\n{"a":1}\n```\n\n```hex example=hi\n\n```\n'


def test_an_example_is_filled_in_with_its_packet(tmp_path: Path) -> None:
    filled = prose.fill_in_packets(EXAMPLE, "1.0")
    assert filled == EXAMPLE.replace("\n\n```\n", "\n07 00 00 00 7b 22 61 22 3a 31 7d\n```\n")
    assert prose.fill_in_packets(filled, "1.0") == filled
    chapter(tmp_path, filled)
    (example,) = prose.examples("1.0", tmp_path)
    assert example.payload == b'{"a":1}'
    assert example.packet == b"\x07\0\0\0" + example.payload


def test_a_long_packet_is_in_the_vectors_alone(tmp_path: Path) -> None:
    long = EXAMPLE.replace("1}", "1" * 200 + "}")
    linked = prose.fill_in_packets(long, "1.1")
    assert linked.endswith("```\n\nThe packet: [`1.1/hi`](../vectors/packets.json).\n")
    assert prose.fill_in_packets(linked, "1.1") == linked
    assert "```hex" in prose.fill_in_packets(linked.replace("1" * 100, "1"), "1.1")
    chapter(tmp_path, linked, version="1.1")
    chapter(tmp_path, EXAMPLE)
    short, other = json.loads(prose.rendered_packets(tmp_path))["cases"]
    assert (short["name"], other["name"]) == ("1.0/hi", "1.1/hi")
    assert bytes.fromhex(other["hex"])[4:] == other["payload"].encode()
    assert ("since" in short, other["since"]) == (False, "1.1")


def test_a_dump_has_32_bytes_a_line() -> None:
    lines = prose.Example("long", b"x" * 61, "").dump.splitlines()
    assert [len(bytes.fromhex(line)) for line in lines] == [32, 32, 1]
