"""The action does in a job what `in-ci.md` says: its steps are run as a runner runs them.

`actions/setup-python`, which is not ours, is left out, and the packages that this project depends
on are those of this environment: nothing is fetched.
"""

import json
import os
import re
import shlex
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml
from splatbus_conformance.cli.parsing import parser

from tests.guides.desk import CLIENT, EXAMPLE, GUIDES
from tests.guides.pages import ROOT

ACTION = yaml.safe_load((ROOT / "action.yml").read_text("utf-8"))
STEPS = {it["id"]: it for it in ACTION["runs"]["steps"]}
WORKFLOW = yaml.safe_load((GUIDES / "ci" / "github-workflow.yml").read_text("utf-8"))
GITLAB = yaml.safe_load((GUIDES / "ci" / "gitlab-ci.yml").read_text("utf-8"))["splatbus"]
PAGE = (GUIDES / "in-ci.md").read_text("utf-8")
EXPRESSION = re.compile(r"\$\{\{ *(.+?) *\}\}")
QUICK = "--profile brief --select FRM-3 --shrink 0"
LEAVES_EMPTY_PAYLOADS = ("if not 1 <= length", "if not 0 <= length")

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the steps are for bash")


class Step(NamedTuple):
    """What a runner knows after a step."""

    status: int
    outputs: dict[str, str]
    summary: str
    log: str


def step(folder: Path, name: str, known: dict[str, str], **added: str) -> Step:
    """Run one step as a runner does, with the values of what expressions name."""

    def filled(text: str) -> str:
        return EXPRESSION.sub(lambda each: known[each[1]], text)

    found, outputs, summary = STEPS[name], folder / "outputs", folder / "summary"
    for path in (outputs, summary):
        path.write_text("")
    runner = {"RUNNER_TEMP": str(folder), "GITHUB_ACTION_PATH": str(ROOT)}
    runner |= {"GITHUB_OUTPUT": str(outputs), "GITHUB_STEP_SUMMARY": str(summary)}
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", found["run"]],
        cwd=folder / filled(found.get("working-directory", ".")),
        env={**os.environ, "PYTHONPATH": sysconfig.get_path("purelib"), **added, **runner}
        | {key: filled(value) for key, value in found["env"].items()},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=200,
    )
    told = dict(line.split("=", 1) for line in outputs.read_text().splitlines())
    return Step(done.returncode, told, summary.read_text(), done.stdout)


Judges = Callable[..., Step]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The outputs of the steps before the last one, of a pip that fetches nothing."""
    folder = tmp_path_factory.mktemp("runner")
    known = {"steps.python.outputs.python-path": sys.executable}
    pip = {"NO_INDEX": "1", "NO_DEPS": "1", "NO_BUILD_ISOLATION": "0", "IGNORE_INSTALLED": "1"}
    pip["CACHE_DIR"] = str(folder / "pip-cache")
    done = step(folder, "install", known, **{f"PIP_{name}": it for name, it in pip.items()})
    assert done.status == 0, done.log
    return known | {f"steps.install.outputs.{name}": it for name, it in done.outputs.items()}


@pytest.fixture
def judged(installed: dict[str, str], tmp_path: Path) -> Judges:
    """Calls the action with these inputs."""

    def judge(**inputs: str) -> Step:
        given = {name: str(it["default"]) for name, it in ACTION["inputs"].items()}
        given |= {name.replace("_", "-"): value for name, value in inputs.items()}
        return step(
            tmp_path, "judge", installed | {f"inputs.{name}": it for name, it in given.items()}
        )

    return judge


def test_a_client_that_conforms_is_told_so(judged: Judges, tmp_path: Path) -> None:
    job = judged(launch=CLIENT, options=QUICK)
    assert job.status == 0, job.log
    assert job.outputs == {"status": "0", "reports": "./splatbus-reports"}
    reports = tmp_path / job.outputs["reports"]
    assert json.loads((reports / "report.json").read_text("utf-8"))["exitCode"] == 0
    for name in ("report.xml", "report.html", "report.md", "badge.json"):
        assert name in PAGE
        assert (reports / name).stat().st_size > 0
    assert "conforming at L1" in job.summary
    again = judged(launch=CLIENT, options=QUICK)
    assert again.summary.count("## ") == job.summary.count("## "), "no summary is repeated"


def test_one_that_does_not_fails_the_job_and_leaves_its_script(
    judged: Judges, tmp_path: Path
) -> None:
    source = EXAMPLE.read_text("utf-8")
    assert source.count(LEAVES_EMPTY_PAYLOADS[0]) == 1
    (tmp_path / "viewers").mkdir()
    (tmp_path / "viewers" / "mine.py").write_text(source.replace(*LEAVES_EMPTY_PAYLOADS), "utf-8")
    launch = f'"{sys.executable}" mine.py'
    job = judged(launch=launch, options=QUICK, working_directory="viewers")
    assert job.status == 1, job.log
    assert job.outputs == {"status": "1", "reports": "viewers/splatbus-reports"}
    assert list((tmp_path / job.outputs["reports"] / "failures").glob("FRM-3-*.json"))
    assert "not conforming" in job.summary


@pytest.mark.parametrize(
    ("inputs", "status", "told"),
    [
        ({}, 2, "status 2"),
        ({"launch": "./not-there"}, 3, "no verdict"),
        ({"launch": CLIENT, "options": "--no-such-option"}, 2, "status 2"),
        ({"launch": '$(touch hit) `touch hit`; touch hit "', "options": QUICK}, 2, "status 2"),
    ],
)
def test_no_verdict_fails_the_job_and_says_where_to_look_and_what_is_hostile_runs_nothing(
    judged: Judges, tmp_path: Path, inputs: dict[str, str], status: int, told: str
) -> None:
    job = judged(**inputs)
    assert (job.status, job.outputs["status"]) == (status, str(status)), job.log
    assert told in job.summary
    assert not (tmp_path / "hit").exists()
    for each in STEPS.values():  # inputs reach them through the environment
        assert not EXPRESSION.search(each.get("run", ""))


@pytest.mark.parametrize("name", ["reports", "working_directory"])
@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_no_input_forges_an_output(name: str, end: str, judged: Judges, tmp_path: Path) -> None:
    folder = f"here{end}status=0"
    (tmp_path / folder).mkdir()
    job = judged(launch="./not-there", **{name: folder})
    assert (job.status, job.outputs) == (2, {}), job.log
    assert "one line each" in job.log


def test_the_page_describes_every_input_and_output() -> None:
    rows = re.findall(r"^\| `([\w-]+)` \| ([^|]*)\|", PAGE, re.MULTILINE)
    assert [name for name, _ in rows] == [*ACTION["inputs"], *ACTION["outputs"]]
    for (name, default), it in zip(rows, ACTION["inputs"].values(), strict=False):
        assert default.strip(" `") == str(it["default"]), name


def test_what_is_to_be_copied_gives_inputs_and_options_that_there_are() -> None:
    (shown,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    calls = [*yaml.safe_load(shown), *WORKFLOW["jobs"]["conformance"]["steps"]]
    found = [it["with"] for it in calls if "launch" in str(it)]
    assert len(found) == 2
    for call in found:
        assert set(call) <= set(ACTION["inputs"])
        for profile in ("quick", "full"):
            options = EXPRESSION.sub(profile, call["options"]).split()
            assert parser().parse_args(["client", "--wait", *options])
    arguments = parser().parse_args(shlex.split(GITLAB["script"][-1])[1:])
    assert arguments.junit == GITLAB["artifacts"]["reports"]["junit"]
