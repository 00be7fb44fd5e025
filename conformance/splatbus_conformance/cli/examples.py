"""What `--help` ends with: examples, and what the exit status says."""

EXAMPLES = {
    "": """\
examples:
  splatbus-conformance demo
      judge the reference client, to see what a verdict looks like
  splatbus-conformance client --launch "./my-viewer --headless"
      start my-viewer as often as needed, and judge it
  splatbus-conformance server --launch "./my-renderer"
      start my-renderer, and judge it as a server
  splatbus-conformance audit session.jsonl
      judge a recorded session, both sides of it
  splatbus-conformance proxy --to 127.0.0.1:6001,6000
      stand between a client and a server, and judge both while they talk
  splatbus-conformance explain FRM-3
      the sentence, what it accepts, and how it is checked

`splatbus-conformance COMMAND --help` shows its options.

exit status: 0 conforming, 1 not conforming, 2 usage, 3 no verdict, 130 interrupted
""",
    "client": """\
examples:
  splatbus-conformance client --launch "./my-viewer --headless" --html report.html
      start my-viewer as often as needed, judge it, and write a page about it
  splatbus-conformance client --launch ./my-viewer --parallel 4 --profile full
      deliver many more cases, to four of them at once
  splatbus-conformance client --launch ./my-viewer --select FRM,JSN-6 --record sessions
      judge only the clause FRM and one requirement, and record what crosses the wire
  splatbus-conformance client --launch ./my-viewer --write-expected known.toml
      list what is broken today; with --expect-failures known.toml only changes fail
  splatbus-conformance client --launch ./my-viewer --junit report.xml --json report.json
      in a CI job; `report report.json --html report.html` makes a page of it later
  splatbus-conformance client --wait --ports 6001,6000
      wait for a client that you start by hand, or inside an engine
""",
    "server": """\
examples:
  splatbus-conformance server --launch "./my-renderer" --html report.html
      start my-renderer as often as needed, judge it, and write a page about it
  splatbus-conformance server --launch ./my-renderer --junit report.xml --json report.json
      in a CI job
  splatbus-conformance server --connect --ports 6001,6000
      judge one that runs already
""",
    "compare": """\
examples:
  splatbus-conformance compare before.json after.json
      what was mended, and what broke
  splatbus-conformance compare reports --html gallery.html
      a page about all programs with a report in the folder
""",
    "replay": """\
examples:
  splatbus-conformance replay splatbus-failures/FRM-3-bad_length_closes.json \\
      --launch ./my-viewer
      the command that stands below a failure: see it again
  splatbus-conformance replay session.jsonl client --launch ./my-viewer
      say to my-viewer what the server in this recording said, and judge it

exit status: 1 it fails again, 0 it does not, 3 no verdict
""",
    "audit": """\
examples:
  splatbus-conformance audit session.jsonl --html session.html
      judge both sides, and write a page about them
  splatbus-conformance audit sessions/*.jsonl --peer client --junit report.xml
      judge the client in each of these, for a CI system
  tcpdump -i any -s 0 -w session.pcap "tcp port 6001 or tcp port 6000"
  splatbus-conformance audit session.pcap
      start the capture before the client connects, then judge it
""",
    "proxy": """\
examples:
  splatbus-conformance proxy --listen 127.0.0.1:7001,7000 --to 127.0.0.1:6001,6000
      pass on what comes to 7001 (IPC) and 7000 (messages), until Ctrl-C
  splatbus-conformance proxy --seconds 60 --html session.html
      for a minute, and write a page about it
""",
    "report": """\
examples:
  splatbus-conformance report report.json --html report.html
      a page, from what an earlier run wrote with --json
  splatbus-conformance report report.json --markdown "$GITHUB_STEP_SUMMARY" --badge badge.json
      the summary of a step in a workflow of GitHub, and a badge
  splatbus-conformance report --schema
      the JSON Schema of what --json writes

exit status: 0 the reports are made, whatever they say; 2 the file is not a report
""",
}
"""By command; the first is of them all."""
