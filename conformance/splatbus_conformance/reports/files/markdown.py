"""Markdown for the summary of a CI step (GitHub's flavour): what failed, and how to see it again.

What a testee may have sent stands in code spans and fences alone, each with more backticks than
it holds in a row.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from splatbus_schemas.visible import visible

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.results import ReportedResult, results

MOST_BYTES = 1 << 20
"""What GitHub shows of a step; of a longer summary it shows nothing."""
MOST_LINE, MOST_TRANSCRIPT = 500, 8000
"""Characters of what is shown of one result."""
VERDICTS = {
    "pass": "met",
    "fail": "broken",
    "warn": "advice not followed",
    "expected": "broken, as expected",
    "harness-error": "no verdict",
    "skip": "not observed",
}
CODE = re.compile("`([^`]+)`")
LEFT_OUT = "Too long for a summary: {:,} parts more are in the other reports.\n"


def markdown_report(reports: Iterable[Report], most: int = MOST_BYTES) -> str:
    """The reports as Markdown of at most so many bytes in UTF-8; what does not fit is counted."""
    parts = [part for report in reports for part in _parts(report)]
    kept: list[str] = []
    room = most - len(LEFT_OUT.format(len(parts)).encode())
    for number, part in enumerate(parts):
        room -= len(part.encode()) + len("\n")
        if room < 0:
            kept.append(LEFT_OUT.format(len(parts) - number))
            break
        kept.append(part)
    return "\n".join(kept)


def _parts(report: Report) -> Iterator[str]:
    told = list(results(report))
    yield f"## SplatBus conformance: {report['side']} {code(report['testee'])}\n"
    yield f"**{plain(report['summary'])}**\n"
    yield _counts(report)
    yield f"{_circumstances(report)}\n"
    for complaint in report["complaints"]:
        yield f"- {plain(complaint)}\n"
    for advice in report["advice"]:
        yield f"{plain(advice)}\n"
    for verdict in ("fail", "harness-error"):
        for each in told:
            if each.result["verdict"] == verdict:
                yield f"### {VERDICTS[verdict]}: {_title(each)}\n\n{_account(each)}"
    for verdict in ("warn", "expected"):
        for each in told:
            if each.result["verdict"] == verdict:
                yield _folded(f"{VERDICTS[verdict]}: {_title(each)}", _account(each))
    yield from _not_observed(report)


def _counts(report: Report) -> str:
    count = Counter(entry["verdict"] for entry in report["requirements"])
    rows = (f"| {words} | {count[name]} |" for name, words in VERDICTS.items() if count[name])
    return "\n".join(("| requirements | |", "|---|---:|", *rows, ""))


def _circumstances(report: Report) -> str:
    found = [f"SplatBus {report['version']}", f"assurance {report['level']}"]
    if report["profile"]:
        found.append(f"profile {report['profile']}")
        found.append(f"seed {', '.join(map(str, report['seeds']))}")
    if report["casesDelivered"]:
        found.append(f"{report['casesDelivered']:,} cases")
    harness = f"splatbus-conformance {report['environment']['harness']}"
    return plain("; ".join((*found, f"{report['seconds']:.1f} s", harness)))


def _title(told: ReportedResult) -> str:
    check = told.result["check"].removeprefix("check_").replace("_", " ")
    return " ".join(
        f"{told.requirement or 'the run'}, {check} ({told.result['assurance']})".split()
    )


def _account(told: ReportedResult) -> str:
    """What was to come, what came, what crossed the wire, and how to see it again."""
    result = told.result
    lines = [f"Seen: {code(result['text'])}\n"]
    if told.sentence:
        lines.insert(0, f"> {_sentence(told.sentence)}\n")
        lines.insert(1, f"Acceptable: {plain(', '.join(told.acceptable))}\n")
    if result["evidence"]:
        lines.append(fenced("\n".join(result["evidence"]), "text"))
    if result["replay"]:
        lines.append(f"Smallest: {code(result['smallest'])}. To see it again:\n")
        lines.append(fenced(result["replay"], "sh"))
    return "\n".join(lines)


def _sentence(text: str) -> str:
    """A requirement, of whose Markdown only code is kept: a stored report may say anything."""
    parts = enumerate(CODE.split(" ".join(text.split())))
    return "".join(code(part) if place % 2 else _escaped(part) for place, part in parts)


def _not_observed(report: Report) -> Iterator[str]:
    unseen: dict[str, list[str]] = {}
    for entry in report["requirements"]:
        if entry["verdict"] == "skip":
            unseen.setdefault(_reason(entry), []).append(entry["id"])
    if unseen:
        lines = (f"- {', '.join(ids)}: {reason}\n" for reason, ids in unseen.items())
        count = sum(map(len, unseen.values()))
        yield _folded(f"{count} requirements were not observed", "".join(lines))
    if report["notJudged"]:
        lines = (f"- {code(line)}\n" for line in report["notJudged"])
        yield _folded("what no rule could judge", "".join(lines))


def _reason(entry: Report) -> str:
    if entry["results"]:
        return code(entry["results"][0]["text"])
    return "deselected" if entry["deselected"] else "nothing exercised it"


def _folded(title: str, text: str) -> str:
    # Without the empty lines the inside would be taken for HTML.
    return f"<details><summary>{title}</summary>\n\n{text}\n</details>\n"


def code(text: str) -> str:
    """A code span of one line."""
    text = " ".join(visible(_cut(text, MOST_LINE), kept="\n\t").split()) or "…"
    ticks = "`" * (_longest_run(text) + 1)
    pad = " " if "`" in (text[0], text[-1]) else ""
    return f"{ticks}{pad}{text}{pad}{ticks}"


def fenced(text: str, language: str) -> str:
    """A block of code, a line feed at its end."""
    text = visible(_cut(text, MOST_TRANSCRIPT), kept="\n\t")
    fence = "`" * max(3, _longest_run(text) + 1)
    return f"{fence}{language}\n{text}\n{fence}\n"


def plain(text: str) -> str:
    """Words of ours, which may quote others: one line in which no character has a meaning."""
    return _escaped(" ".join(visible(text, kept="\n\t").split()))


def _escaped(text: str) -> str:
    return re.sub(r"([\\`*_\[\]<>#|~&!/.+-])", r"\\\1", visible(text))


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[:most]} …"


def _longest_run(text: str) -> int:
    runs: Sequence[str] = re.findall("`+", text)
    return max(map(len, runs), default=0)
