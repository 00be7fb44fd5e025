"""JUnit XML: one suite for each report, one test case for each result and for each complaint.

Nobody owns this format. What is written satisfies both schemas in use: the one of Jenkins, and the
older one of Ant, which wants a package, a number, a host, empty output and a type of each failure.
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
_seen = partial(visible, kept="\n\t")
PROPERTIES = ("summary", "side", "version", "level", "observed", "casesDelivered", "profile")


def junit_report(reports: Iterable[Report]) -> bytes:
    """The reports as JUnit XML, in UTF-8.

    Warnings and expected failures are skipped tests.
    """
    suites = ElementTree.Element("testsuites")
    suites.extend(_suite(report, number) for number, report in enumerate(reports))
    ElementTree.indent(suites)
    return bytes(ElementTree.tostring(suites, encoding="utf-8", xml_declaration=True)) + b"\n"


def _suite(report: Report, number: int) -> ElementTree.Element:
    told, complaints = list(results(report)), report["complaints"]
    verdicts = [each.result["verdict"] for each in told]
    package = f"splatbus.{report['side']}"
    suite = ElementTree.Element(
        "testsuite",
        name=f"SplatBus conformance: {_seen(report['testee'])}",
        package=package,
        id=str(number),
        timestamp=report["made"][: len("2026-01-01T00:00:00")],
        hostname=_seen(report["environment"]["host"]).strip() or "localhost",
        tests=str(len(told) + len(complaints)),
        failures=str(verdicts.count("fail") + len(complaints)),
        errors=str(verdicts.count("harness-error")),
        skipped=str(sum(verdict in SKIPPED for verdict in verdicts)),
        time=f"{report['seconds']:.3f}",
    )
    properties = ElementTree.SubElement(suite, "properties")
    for name, value in _properties(report):
        ElementTree.SubElement(properties, "property", name=name, value=_seen(value))
    suite.extend(_case(each, package) for each in told)
    suite.extend(_complaint(_seen(text), package) for text in complaints)
    said = _seen("\n".join((report["summary"], *report["advice"], *report["notJudged"])))
    ElementTree.SubElement(suite, "system-out").text = said
    ElementTree.SubElement(suite, "system-err")
    return suite


def _properties(report: Report) -> Iterator[tuple[str, str]]:
    """What a suite says of the whole run: names, and values as text."""
    for name in PROPERTIES:
        if report[name] is not None:
            yield name, str(report[name])
    if report["seeds"]:
        yield "seeds", ",".join(map(str, report["seeds"]))
    yield from ((name, str(value)) for name, value in report["environment"].items())


def _case(told: ReportedResult, package: str) -> ElementTree.Element:
    result, requirement = told.result, told.requirement or "run"
    case = ElementTree.Element(
        "testcase",
        classname=f"{package}.{requirement}",
        name=_seen(f"{requirement} {result['check']} ({result['assurance']})"),
        time=f"{result['seconds']:.3f}",
    )
    verdict, text = result["verdict"], _seen(result["text"])
    if verdict in BROKEN:
        broken = ElementTree.SubElement(
            case, BROKEN[verdict], type=result["code"] or verdict, message=text
        )
        broken.text = _seen("\n".join(_account(told)))
    elif verdict in SKIPPED:
        ElementTree.SubElement(case, "skipped", message=SKIPPED[verdict] + text)
    return case


def _account(told: ReportedResult) -> Iterator[str]:
    """Of what is broken: what was to come, what came, the bytes, and how to see it again."""
    result = told.result
    if told.sentence:
        yield f"the standard: {told.sentence}"
        yield f"acceptable: {', '.join(told.acceptable)}"
    yield f"seen: {result['text']}"
    yield from result["evidence"]
    if result["replay"]:
        yield f"smallest: {result['smallest']}"
        yield f"to see it: {result['replay']}"


def _complaint(text: str, package: str) -> ElementTree.Element:
    case = ElementTree.Element("testcase", classname=f"{package}.run", name=text, time="0.000")
    ElementTree.SubElement(case, "failure", type="complaint", message=text)
    return case
