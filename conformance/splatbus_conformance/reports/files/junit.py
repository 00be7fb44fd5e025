"""JUnit XML: one suite for each report, one test case for each result and for each complaint.

Nobody owns this format. What is written satisfies the schema of Jenkins, by which others go.
"""

from collections.abc import Iterable, Iterator
from functools import partial
from xml.etree import ElementTree

from splatbus_schemas.visible import visible

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.results import ReportedResult, results

SKIPPED = {"skip": "", "warn": "warning: ", "expected": "expected failure: "}
"""What JUnit has no word for, and how the reason of its skipped test begins."""
BROKEN = {"fail": "failure", "harness-error": "error"}
PROPERTIES = ("summary", "side", "version", "level", "observed", "casesDelivered", "profile")
_seen = partial(visible, kept="\n\t")


def junit_report(reports: Iterable[Report]) -> bytes:
    """The reports as JUnit XML, in UTF-8.

    Warnings and expected failures are skipped tests.
    """
    suites = ElementTree.Element("testsuites")
    suites.extend(map(_suite, reports))
    ElementTree.indent(suites)
    return bytes(ElementTree.tostring(suites, encoding="utf-8", xml_declaration=True)) + b"\n"


def _suite(report: Report) -> ElementTree.Element:
    side = f"splatbus.{report['side']}"
    cases = [_case(it, side) for it in results(report)]
    cases += [_complaint(_seen(text), side) for text in report["complaints"]]
    outcomes = [outcome.tag for case in cases for outcome in case]
    suite = ElementTree.Element(
        "testsuite",
        name=f"SplatBus conformance: {_seen(report['testee'])}",
        timestamp=report["made"].removesuffix("+00:00"),
        hostname=_seen(report["environment"]["host"]),
        tests=str(len(cases)),
        failures=str(outcomes.count("failure")),
        errors=str(outcomes.count("error")),
        skipped=str(outcomes.count("skipped")),
        time=f"{report['seconds']:.3f}",
    )
    properties = ElementTree.SubElement(suite, "properties")
    told = {name: report[name] for name in PROPERTIES}
    told |= {"seeds": ",".join(map(str, report["seeds"]))} | report["environment"]
    for name, value in told.items():
        if value not in ("", None):
            ElementTree.SubElement(
                properties, "property", name=_seen(name), value=_seen(str(value))
            )
    suite.extend(cases)
    said = "\n".join((report["summary"], *report["advice"], *report["notJudged"]))
    ElementTree.SubElement(suite, "system-out").text = _seen(said)
    return suite


def _case(it: ReportedResult, side: str) -> ElementTree.Element:
    requirement, verdict, text = it["requirement"] or "run", it["verdict"], _seen(it["text"])
    case = ElementTree.Element(
        "testcase",
        classname=f"{side}.{requirement}",
        name=_seen(f"{requirement} {it['check']} ({it['assurance']})"),
        time=f"{it['seconds']:.3f}",
    )
    if verdict in BROKEN:
        how = {"type": it["code"] or verdict, "message": text}
        account = ElementTree.SubElement(case, BROKEN[verdict], how)
        account.text = _seen("\n".join(_account(it)))
    elif verdict in SKIPPED:
        ElementTree.SubElement(case, "skipped", message=SKIPPED[verdict] + text)
    return case


def _account(it: ReportedResult) -> Iterator[str]:
    """Of what is broken: what was to come, what came, the bytes, and how to see it again."""
    if it["sentence"]:
        yield f"the standard: {it['sentence']}"
        yield f"acceptable: {', '.join(it['acceptable'])}"
    yield f"seen: {it['text']}"
    yield from it["evidence"]
    if it["replay"]:
        yield f"smallest: {it['smallest']}"
        yield f"to see it: {it['replay']}"


def _complaint(text: str, side: str) -> ElementTree.Element:
    case = ElementTree.Element("testcase", classname=f"{side}.run", name=text, time="0.000")
    ElementTree.SubElement(case, "failure", type="complaint", message=text)
    return case
