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
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import pytest
import splatbus_conformance.cli.parsing
import yaml

from tests.guides.desk import CLIENT, EXAMPLE, GUIDES
from tests.guides.pages import ROOT

ACTION = yaml.safe_load((ROOT / "action.yml").read_text("utf-8"))
STEPS = ACTION["runs"]["steps"]
WORKFLOW = yaml.safe_load((GUIDES / "ci" / "github-workflow.yml").read_text("utf-8"))
GITLAB = yaml.safe_load((GUIDES / "ci" / "gitlab-ci.yml").read_text("utf-8"))
PAGE = (GUIDES / "in-ci.md").read_text("utf-8")
EXPRESSION = re.compile(r"\$\{\{ *(.+?) *\}\}")
QUICK = "--profile brief --select FRM-3 --shrink 0"
LEAVES_EMPTY_PAYLOADS = ("if not 1 <= length", "if not 0 <= length")

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the steps are for bash")


class Job(NamedTuple):
    """What a runner knows after the steps."""

    status: int
    outputs: dict[str, str]
    summary: str
    folder: Path
    log: str


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The outputs of the steps before the last one."""
    folder = tmp_path_factory.mktemp("runner")
    known = {"steps.python.outputs.python-path": sys.executable}
    status, outputs, _, log = step(folder, "install", known, packages_of_this_environment(folder))
    assert status == 0, log
    return known | {f"steps.install.outputs.{name}": value for name, value in outputs.items()}


def packages_of_this_environment(folder: Path) -> dict[str, str]:
    """Settings by which pip fetches nothing, touches nothing here, and finds its build backend."""
    return {
        "PYTHONPATH": sysconfig.get_path("purelib"),
        "PIP_NO_INDEX": "1",
        "PIP_NO_DEPS": "1",
        "PIP_NO_BUILD_ISOLATION": "0",
        "PIP_IGNORE_INSTALLED": "1",
        "PIP_CACHE_DIR": str(folder / "pip-cache"),
    }


def step(
    folder: Path, name: str, known: dict[str, str], added: dict[str, str]
) -> tuple[int, dict[str, str], str, str]:
    """Run one step as a runner does: status, outputs, summary, log."""
    (found,) = [it for it in STEPS if it["id"] == name]
    files = {key: folder / key for key in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")}
    for path in files.values():
        path.write_text("")
    filled = {
        key: EXPRESSION.sub(lambda each: known[each[1]], value)
        for key, value in found["env"].items()
    }
    runner = {"RUNNER_TEMP": str(folder), "GITHUB_ACTION_PATH": str(ROOT)}
    where = EXPRESSION.sub(lambda each: known[each[1]], found.get("working-directory", "."))
    script = folder / f"{name}.sh"
    script.write_text(found["run"])
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(script)],
        cwd=folder / where,
        env=os.environ | added | runner | filled | {key: str(it) for key, it in files.items()},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=200,
    )
    written = files["GITHUB_OUTPUT"].read_text().splitlines()
    outputs = dict(line.split("=", 1) for line in written)
    return done.returncode, outputs, files["GITHUB_STEP_SUMMARY"].read_text(), done.stdout


def judged(installed: dict[str, str], tmp_path: Path, **inputs: str) -> Job:
    """What comes of calling the action with these inputs."""
    given = {name: str(it["default"]) for name, it in ACTION["inputs"].items()}
    given |= {name.replace("_", "-"): value for name, value in inputs.items()}
    known = installed | {f"inputs.{name}": value for name, value in given.items()}
    packages = {"PYTHONPATH": sysconfig.get_path("purelib")}
    status, outputs, summary, log = step(tmp_path, "judge", known, packages)
    return Job(status, outputs, summary, tmp_path, log)


def test_a_client_that_conforms_is_told_so(installed: dict[str, str], tmp_path: Path) -> None:
    job = judged(installed, tmp_path, launch=CLIENT, options=QUICK)
    assert job.status == 0, job.log
    assert job.outputs == {"status": "0", "reports": "./splatbus-reports"}
    reports = job.folder / job.outputs["reports"]
    assert json.loads((reports / "report.json").read_text("utf-8"))["exitCode"] == 0
    assert ElementTree.parse(reports / "report.xml").getroot().tag.startswith("testsuite")
    assert "<html" in (reports / "report.html").read_text("utf-8")
    assert json.loads((reports / "badge.json").read_text("utf-8"))["schemaVersion"] == 1
    assert "conforming at L1" in job.summary
    assert job.summary == (reports / "report.md").read_text("utf-8")
    again = judged(installed, tmp_path, launch=CLIENT, options=QUICK)
    assert again.summary.count("## ") == job.summary.count("## "), "no summary is repeated"


def test_one_that_does_not_fails_the_job_and_leaves_its_script(
    installed: dict[str, str], tmp_path: Path
) -> None:
    source = EXAMPLE.read_text("utf-8")
    assert source.count(LEAVES_EMPTY_PAYLOADS[0]) == 1
    (tmp_path / "viewers").mkdir()
    (tmp_path / "viewers" / "mine.py").write_text(source.replace(*LEAVES_EMPTY_PAYLOADS), "utf-8")
    job = judged(
        installed,
        tmp_path,
        launch=f'"{sys.executable}" mine.py',
        options=QUICK,
        working_directory="viewers",
    )
    assert job.status == 1, job.log
    assert job.outputs == {"status": "1", "reports": "viewers/splatbus-reports"}
    scripts = (job.folder / job.outputs["reports"] / "failures").glob("FRM-3-*.json")
    assert list(scripts)
    assert "FRM-3" in job.summary
    assert "not conforming" in job.summary


@pytest.mark.parametrize(
    ("inputs", "status", "told"),
    [
        ({}, 2, "status 2"),
        ({"launch": "./not-there"}, 3, "no verdict"),
        ({"launch": CLIENT, "options": "--no-such-option"}, 2, "status 2"),
    ],
    ids=["nothing to start", "it cannot be started", "no such option"],
)
def test_no_verdict_fails_the_job_and_says_where_to_look(
    installed: dict[str, str], tmp_path: Path, inputs: dict[str, str], status: int, told: str
) -> None:
    job = judged(installed, tmp_path, **inputs)
    assert job.status == status, job.log
    assert job.outputs["status"] == str(status)
    assert told in job.summary


def test_what_a_caller_gives_is_never_read_as_a_script() -> None:
    """Inputs reach the steps through the environment: text in them runs nothing."""
    for each in STEPS:
        assert not EXPRESSION.search(each.get("run", "")), each["id"]


def test_a_hostile_launch_line_runs_nothing(installed: dict[str, str], tmp_path: Path) -> None:
    job = judged(installed, tmp_path, launch='$(touch hit) `touch hit`; touch hit "', options=QUICK)
    assert job.status in (2, 3), job.log
    assert not (job.folder / "hit").exists()


@pytest.mark.parametrize("name", ["reports", "working_directory"])
@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_no_input_forges_an_output(
    name: str, end: str, installed: dict[str, str], tmp_path: Path
) -> None:
    folder = f"here{end}status=0"
    (tmp_path / folder).mkdir()
    job = judged(installed, tmp_path, launch="./not-there", **{name: folder})
    assert job.status == 2, job.log
    assert job.outputs == {}
    assert "one line each" in job.log


def test_the_page_describes_every_input_and_output() -> None:
    described = re.findall(r"^\| `([\w-]+)` \|", PAGE, re.MULTILINE)
    assert described == [*ACTION["inputs"], *ACTION["outputs"]]
    for name, it in ACTION["inputs"].items():
        row = next(row for row in PAGE.splitlines() if row.startswith(f"| `{name}` |"))
        default = row.split("|")[2].strip().strip("`")
        assert default == str(it["default"]), name


def test_the_workflow_gives_only_inputs_that_there_are() -> None:
    (call,) = [it for it in WORKFLOW["jobs"]["conformance"]["steps"] if "launch" in str(it)]
    assert set(call["with"]) <= set(ACTION["inputs"])
    for profile in ("quick", "full"):
        options = EXPRESSION.sub(profile, call["with"]["options"]).split()
        assert splatbus_conformance.cli.parsing.parser().parse_args(["client", "--wait", *options])


def test_the_part_that_the_page_shows_is_good() -> None:
    (shown,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (call,) = yaml.safe_load(shown)
    assert set(call["with"]) <= set(ACTION["inputs"])
    options = call["with"]["options"].split()
    assert splatbus_conformance.cli.parsing.parser().parse_args(["client", "--wait", *options])


def test_the_job_for_gitlab_has_options_that_there_are() -> None:
    script = GITLAB["splatbus"]["script"][-1]
    _, *words = shlex.split(script)
    arguments = splatbus_conformance.cli.parsing.parser().parse_args(words)
    assert arguments.junit == GITLAB["splatbus"]["artifacts"]["reports"]["junit"]
