"""`audit`, `list` and `explain`, as their users run them."""

import json
from pathlib import Path

import jsonschema
import pytest
from splatbus_conformance.cli.main import main
from splatbus_conformance.data import read_json
from splatbus_schemas.requirements import requirements

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"


def recording(name: str) -> str:
    return str(RECORDINGS / f"{name}.jsonl")


def test_audit_says_what_the_opengl_viewer_breaks(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--plain", "audit", recording("opengl-viewer"), "--peer", "client"]) == 1
    output = capsys.readouterr().out
    assert "client: not conforming: JSN-4 broken" in output
    assert "/position/x" in output
    assert "server:" not in output


def test_audit_passes_unity_and_strict_does_not(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--plain", "audit", recording("unity-csharp"), "--peer", "client"]
    assert main(arguments) == 0
    assert "advice not followed: FRM-7" in capsys.readouterr().out
    assert main([*arguments, "--strict"]) == 1


def test_audit_writes_a_report_for_each_file_and_peer(tmp_path: Path) -> None:
    path = tmp_path / "audit.json"
    files = [recording("opengl-viewer"), recording("unity-csharp")]
    main(["--plain", "audit", *files, "--json", str(path)])
    reports = json.loads(path.read_text("utf-8"))
    assert [report["exitCode"] for report in reports] == [1, 0, 0, 0]
    for report in reports:
        jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(report)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (None, "No such file"),
        ('{"t": 0}\n', "line 1"),
        ('{"t": 0, "channel": "ipc", "conn": 1, "dir": "c2s", "hex": "0"}\n', "line 1"),
        ("not json\n", "line 1"),
    ],
)
def test_audit_of_what_is_no_recording_is_a_usage_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str | None, complaint: str
) -> None:
    path = tmp_path / "session.jsonl"
    if text is not None:
        path.write_text(text, "utf-8")
    assert main(["--plain", "audit", str(path)]) == 2
    assert complaint in capsys.readouterr().out


def test_audit_of_an_empty_recording_is_no_verdict(tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    path.write_text("", "utf-8")
    assert main(["--plain", "audit", str(path)]) == 3


def test_list_shows_every_requirement(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--plain", "list"]) == 0
    words = capsys.readouterr().out.split()
    assert not [name for name in requirements("1.1") if name not in words]


@pytest.mark.parametrize("name", requirements("1.1"))
def test_explain_gives_the_sentence_and_how_it_is_judged(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--plain", "explain", name.lower()]) == 0
    output = " ".join(capsys.readouterr().out.split())
    assert " ".join(requirements("1.1")[name].sentence.split())[:150] in output
    for peer in requirements("1.1")[name].binds:
        assert f"{peer} " in output


def test_explain_of_an_unknown_id_names_the_families(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--plain", "explain", "FRM-999"]) == 2
    assert "FRM" in capsys.readouterr().out
