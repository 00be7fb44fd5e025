"""Markdown for the summary of a CI step (GitHub's flavour): what failed, and how to see it again.

What a testee may have sent stands in code spans and fences alone, each with more backticks than
it holds in a row.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator

from splatbus_schemas.visible import visible

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.results import ReportedResult, broken, results, unseen
from splatbus_conformance.reports.terminal import words

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
LEFT_OUT = "Too long for a summary: {:,} more parts are in the other reports.\n"


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
    yield f"## SplatBus conformance: {report['side']} {code(report['testee'])}\n"
    yield f"**{plain(report['summary'])}**\n"
    for complaint in report["complaints"]:
        yield f"- **failed:** {plain(complaint)}\n"
    count = Counter(entry["verdict"] for entry in report["requirements"])
    rows = (f"| {said} | {count[name]} |" for name, said in VERDICTS.items() if count[name])
    yield "\n".join(("| requirements | |", "|---|---:|", *rows, ""))
    yield f"{plain(_circumstances(report))}\n"
    for advice in report["advice"]:
        yield f"{plain(advice)}\n"
    told = list(results(report))
    for it in (*broken(told), *(it for it in told if it["verdict"] == "expected")):
        title = f"{VERDICTS[it['verdict']]}: {_title(it)}"
        if it["verdict"] in ("fail", "harness-error"):
            yield f"### {title}\n\n{_account(it)}"
        else:
            yield _folded(title, _account(it))
    if reasons := unseen(report["requirements"], report["side"]):
        lines = (f"- {', '.join(ids)}: {code(reason)}\n" for reason, ids in reasons)
        yield _folded(f"{count['skip']} requirements were not observed", "".join(lines))
    if report["notJudged"]:
        lines = (f"- {code(line)}\n" for line in report["notJudged"])
        yield _folded("No rule could judge this", "".join(lines))


def _circumstances(report: Report) -> str:
    found = f"SplatBus {report['version']}; assurance {report['level']}"
    if report["profile"]:
        found += f"; profile {report['profile']}; seed {', '.join(map(str, report['seeds']))}"
    if report["casesDelivered"]:
        found += f"; {report['casesDelivered']:,} cases"
    harness = report["environment"]["harness"]
    return f"{found}; {report['seconds']:.1f} s; splatbus-conformance {harness}"


def _title(it: ReportedResult) -> str:
    title = f"{it['requirement'] or 'the run'}, {words(it['check'])} ({it['assurance']})"
    return " ".join(title.split())


def _account(it: ReportedResult) -> str:
    """What was to come, what came, what crossed the wire, and how to see it again."""
    lines = []
    if it["sentence"]:
        lines.append(f"> {plain(it['sentence'])}\n")
        lines.append(f"Acceptable: {plain(', '.join(it['acceptable']))}\n")
    lines.append(f"Seen: {code(it['text'])}\n")
    if it["evidence"]:
        lines.append(fenced("\n".join(it["evidence"]), "text"))
    if it["replay"]:
        lines.append(f"Smallest: {code(it['smallest'])}. To see it again:\n")
        lines.append(fenced(it["replay"], "sh"))
    return "\n".join(lines)


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
    line = " ".join(visible(text, kept="\n\t").split())
    return re.sub(r"([\\`*_\[\]<>#|~&!/.+-])", r"\\\1", line)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[:most]} …"


def _longest_run(text: str) -> int:
    return max(map(len, re.findall("`+", text)), default=0)
