"""Reports for programs: JSON with a schema of its own, and JUnit XML."""

import platform
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.findings import Traffic
from splatbus_conformance.verdicts import Result, Verdict, by_requirement, worst

FORMAT = "1"
SKIPPED = {Verdict.SKIP: "", Verdict.WARN: "warning: ", Verdict.EXPECTED: "expected failure: "}
"""What JUnit has no word for, and how the reason of its skipped test begins."""


def json_report(
    testee: str,
    sentence: str,
    results: Iterable[Result],
    judged: Mapping[str, Requirement],
    *,
    exit_code: int,
    traffic: Traffic,
    seconds: float,
    complaints: Iterable[str] = (),
    deselected: Mapping[str, list[str]] = MappingProxyType({}),
    profile: str = "quick",
    seeds: Sequence[int] = (0,),
) -> dict[str, Any]:
    """The report as one object (schema: report.schema.json)."""
    results = list(results)
    groups = by_requirement(results)
    return {
        "format": FORMAT,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "testee": testee,
        "summary": sentence,
        "exitCode": exit_code,
        "casesDelivered": traffic.delivered,
        "seconds": round(seconds, 3),
        "harnessSeconds": round(traffic.busy_seconds, 3),
        "waitingSeconds": round(traffic.waiting_seconds, 3),
        "profile": profile,
        "seeds": list(seeds),
        "complaints": list(complaints),
        "environment": {
            "python": platform.python_version(),
            "platform": sys.platform,
            "device": traffic.device,
        },
        "requirements": [
            {
                "id": requirement.id,
                "level": requirement.level,
                "verdict": worst(groups.get(requirement.id, [])),
                "deselected": deselected.get(requirement.id, []),
                "results": [
                    {
                        "check": result.check,
                        "assurance": result.level,
                        "verdict": result.verdict,
                        "text": result.text,
                        "evidence": list(result.evidence),
                        "seconds": round(result.seconds, 4),
                        "measurements": [it.as_json() for it in result.measurements],
                        "smallest": result.smallest,
                        "replay": result.replay,
                    }
                    for result in groups.get(requirement.id, [])
                ],
            }
            for requirement in judged.values()
        ],
    }


def junit_report(
    testee: str, results: Iterable[Result], seconds: float, complaints: Iterable[str] = ()
) -> bytes:
    """The report as JUnit XML: one test case for each result, and one for each complaint.

    Warnings and expected failures are skipped tests.
    """
    results, complaints = list(results), list(complaints)
    suite = ElementTree.Element(
        "testsuite",
        name=f"SplatBus conformance: {printable(testee)}",
        tests=str(len(results) + len(complaints)),
        failures=str(sum(r.verdict is Verdict.FAIL for r in results) + len(complaints)),
        errors=str(sum(r.verdict is Verdict.ERROR for r in results)),
        skipped=str(sum(r.verdict in SKIPPED for r in results)),
        time=f"{seconds:.3f}",
    )
    for result in results:
        case = ElementTree.SubElement(
            suite,
            "testcase",
            classname=f"splatbus.{result.requirement}",
            name=f"{result.requirement} {result.check} ({result.level})",
            time=f"{result.seconds:.3f}",
        )
        text = printable(result.text)
        body = printable("\n".join((result.text, *result.evidence)))
        if result.verdict is Verdict.FAIL:
            ElementTree.SubElement(case, "failure", message=text).text = body
        elif result.verdict is Verdict.ERROR:
            ElementTree.SubElement(case, "error", message=text).text = body
        elif result.verdict in SKIPPED:
            ElementTree.SubElement(case, "skipped", message=SKIPPED[result.verdict] + text)
    for complaint in map(printable, complaints):
        case = ElementTree.SubElement(suite, "testcase", classname="splatbus.run", name=complaint)
        ElementTree.SubElement(case, "failure", message=complaint)
    suites = ElementTree.Element("testsuites")
    suites.append(suite)
    return bytes(ElementTree.tostring(suites, encoding="utf-8", xml_declaration=True))


def printable(text: str) -> str:
    """`text` without the characters that XML 1.0 forbids: a testee must not break the report."""
    return "".join(
        c if c in "\t\n" or 32 <= ord(c) < 0xD800 or 0xE000 <= ord(c) < 0xFFFE else "·"
        for c in text
    )
