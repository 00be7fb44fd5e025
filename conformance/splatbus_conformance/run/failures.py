"""What is done about failures after a run: they are seen again, made small, and written down."""

import re
import shlex
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from splatbus_conformance.cases.script import Script, from_text, save
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.run.options import as_options
from splatbus_conformance.run.replay import counted, replay, worked_out
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.trials.testee import diagnostics
from splatbus_conformance.verdicts import BROKEN, Result
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.secrets import hidden

Say = Callable[[str], None]


def work_out(
    plan: Plan, results: Sequence[Result], folder: Path, seconds: float, say: Say, busy: str = ""
) -> list[Result]:
    """The results, the failures among them with what is known now; none of them becomes less.

    Where the harness can start new testees, each is delivered again to one, and then with ever
    smaller cases, for so many seconds in all; each is written into the folder as a script. If the
    machine was `busy`, in words, that is said of those that were not seen again.
    """
    failed = [place for place, it in enumerate(results) if it.script and it.verdict in BROKEN]
    scripts = {place: from_text(results[place].script) for place in failed}
    why_not = "--shrink 0 leaves no time" if plan.starts_it else "the harness does not start it"
    if failed and seconds and plan.starts_it:
        what = f"{len(failed)} failures" if len(failed) != 1 else "the failure"
        say(f"delivering {what} again, and making small what shows again, for {seconds:g} s")
        scripts, why_not = _seen_again(plan, scripts, seconds)
    told = list(results)
    for place, script in scripts.items():
        path = folder / _file_name(script)
        seen = script.seen or results[place].text
        try:
            folder.mkdir(parents=True, exist_ok=True)
            told_ = tuple(map(hidden, script.transcript))
            save(replace(script, seen=hidden(seen), transcript=told_), path)
        except OSError as error:
            say(diagnostics.scripts_not_written(str(folder), error))
            break
        told[place] = _with(results[place], script, path, plan, why_not, busy)
    return told


def _seen_again(
    plan: Plan, scripts: dict[int, Script], seconds: float
) -> tuple[dict[int, Script], str]:
    """The scripts, each delivered again before any of them is made small, and why those were not
    that were not.
    """
    until = time.monotonic() + seconds
    made = dict(scripts)
    try:
        testbed = set_up(replace(plan, parallel=1))
    except (Usage, NoVerdict) as error:
        return made, f"no further testee could be started: {error}"
    try:
        testbed.introduce()
        for place, script in scripts.items():
            if time.monotonic() < until:
                made[place] = counted(script, replay(testbed, script))
        for left, place in zip(range(len(made), 0, -1), made, strict=True):
            share = (until - time.monotonic()) / left
            if share > 0:
                made[place] = worked_out(testbed, made[place], share)
    except NoVerdict as error:
        return made, f"no further testee was met: {str(error).splitlines()[0]}"
    except KeyboardInterrupt:
        return made, "it was interrupted"
    except Exception as error:  # verdicts are not lost over what is done about them afterwards
        return made, f"the harness failed: {type(error).__name__}: {error}"
    finally:
        testbed.close()
    return made, "--shrink's time was up"


def _with(
    result: Result, script: Script, path: Path, plan: Plan, why_not: str, busy: str
) -> Result:
    cases = [case for row in script.cases for case in row]
    many = {0: "no special input is needed", 1: "one case"}.get(len(cases), f"{len(cases)} cases")
    if len(cases) == 1 and cases[0].drawn:
        many += f", {shorten(str(cases[0].value))}"
    options = shlex.join(as_options(plan))
    return replace(
        result,
        text=script.seen if script.again and not script.by_rule else result.text,
        evidence=script.transcript or result.evidence,
        smallest=f"{many}; {_how_often(script, why_not, busy)}",
        replay=f"splatbus-conformance replay {shlex.quote(str(path))} {options}",
    )


def _how_often(script: Script, why_not: str, busy: str) -> str:
    if not script.tried:
        return f"not tried again: {why_not}"
    doubt = f". {busy}: judge it again on a quieter one" if busy and not script.again else ""
    return f"tried again {_times(script.tried)}, seen {_times(script.again)}{doubt}"


def _times(count: int) -> str:
    return {0: "never", 1: "once"}.get(count, f"{count} times")


def _file_name(script: Script) -> str:
    name = f"{script.requirement}-{script.check.removeprefix('check_')}"
    return re.sub(r"[^A-Za-z0-9_-]", "-", name) + ("-rule" if script.by_rule else "") + ".json"
