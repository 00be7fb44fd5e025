"""What is done about failures after a run: they are made small, and written down as scripts."""

import re
import shlex
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from splatbus_conformance import mistakes
from splatbus_conformance.lenient_json import shorten
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.replaying import worked_out
from splatbus_conformance.script import Script, from_text, save
from splatbus_conformance.stand import set_up
from splatbus_conformance.verdicts import Result, Verdict

Say = Callable[[str], None]


def work_out(
    plan: Plan, results: Sequence[Result], folder: Path, seconds: float, say: Say
) -> list[Result]:
    """The results, the failures among them with what is known now.

    Each is delivered again to new testees where the harness can start them, with ever smaller
    cases, for so many seconds in all; each is written into the folder as a script.
    """
    broken = (Verdict.FAIL, Verdict.WARN)
    failed = [place for place, it in enumerate(results) if it.script and it.verdict in broken]
    scripts = {place: from_text(results[place].script) for place in failed}
    tries = bool(seconds) and plan.starts_it
    if failed and tries:
        what = f"{len(failed)} failures" if len(failed) != 1 else "the failure"
        say(f"making {what} small, for {seconds:g} s at most")
        scripts = _made_small(plan, scripts, seconds)
    told = list(results)
    for place, script in scripts.items():
        path = folder / _file_name(script)
        seen = script.seen or results[place].text
        try:
            folder.mkdir(parents=True, exist_ok=True)
            save(replace(script, seen=seen), path)
        except OSError as error:
            say(mistakes.scripts_not_written(str(folder), error))
            break
        told[place] = _with(results[place], script, path, plan, tried=tries)
    return told


def _made_small(plan: Plan, scripts: dict[int, Script], seconds: float) -> dict[int, Script]:
    until = time.monotonic() + seconds
    try:
        stand = set_up(replace(plan, parallel=1))
    except (Usage, NoVerdict):
        return scripts
    made = dict(scripts)
    try:
        stand.introduce()
        for left, (place, script) in zip(range(len(scripts), 0, -1), scripts.items(), strict=True):
            share = (until - time.monotonic()) / left
            if share > 0:
                made[place] = worked_out(stand, script, share)
    except NoVerdict:
        pass  # what is not small is written down as it is
    finally:
        stand.close()
    return made


def _with(result: Result, script: Script, path: Path, plan: Plan, *, tried: bool) -> Result:
    cases = [case for row in script.cases for case in row]
    many = {0: "it takes no case", 1: "one case"}.get(len(cases), f"{len(cases)} cases")
    if len(cases) == 1 and cases[0].drawn:
        many += f", {shorten(str(cases[0].value))}"
    times = "failed twice of two" if script.confirmed else "unconfirmed: not seen again"
    told = f"{many}, {times}" if tried else many
    return replace(
        result,
        text=script.seen if script.confirmed and not script.by_rule else result.text,
        evidence=script.transcript or result.evidence,
        smallest=told,
        replay=f"splatbus-conformance replay {shlex.quote(str(path))} {_how(plan)}",
    )


def _how(plan: Plan) -> str:
    device = " --stand-in-cuda" if plan.stand_in_cuda else ""
    if plan.adapter:
        return f"--adapter {shlex.quote(plan.adapter)}{device}"
    if plan.launch:
        return f"--launch {shlex.quote(plan.launch)}{device}"
    way = "--wait" if plan.side == "client" else "--connect"
    return f"{way} --ports {plan.ports[0]},{plan.ports[1]}"


def _file_name(script: Script) -> str:
    name = f"{script.requirement}-{script.check.removeprefix('check_')}"
    return re.sub(r"[^A-Za-z0-9_-]", "-", name) + ("-rule" if script.by_rule else "") + ".json"
