"""`plan`, `diff` and `verify` in the formats of CI, and failures in them."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy

FILE = """nodes:
  drive:
    node_id: 1
    tpdo:
      1: {event_timer: 20}
      2: {enabled: true}
  motor:
    node_id: 5
    heartbeat_producer: 700
"""


def counted(text: str) -> tuple[int, int, int]:
    suites = ET.fromstring(text)  # noqa: S314 - our own
    assert len(suites.findall(".//testcase")) == int(suites.attrib["tests"])
    for kind, tag in (("failures", "failure"), ("errors", "error")):
        assert len(suites.findall(f".//{tag}")) == int(suites.attrib[kind])
    tests, failures, errors = (int(suites.attrib[name]) for name in ("tests", "failures", "errors"))
    return tests, failures, errors


@heavy
def test_github_gets_a_command_for_each_difference(bench: Bench, file: Path) -> None:
    place = f"file={file},line=5,title=node 1::TPDO1 of node 1: event_timer is 0 ms, expected 20 ms"
    assert f"::notice {place}" in bench.run(f"plan {file} --format github").stdout.splitlines()
    ran = bench.run(f"diff {file} --format github")
    assert (ran.code, ran.stdout.splitlines()[0]) == (3, f"::error {place}")
    ran = bench.run(f"verify {file} --format github")
    assert (ran.code, ran.stdout.count("::error ")) == (3, 2)
    assert [line.partition("title")[0] for line in ran.stdout.splitlines()[:2]] == [
        f"::error file={file},line=5,", f"::error file={file},line=9,",
    ]  # fmt: skip
    assert f"::error file={file},line=9,title=node 5::" in bench.run(f"diff {file} --format github").stdout
    assert bench.run(f"apply {file}").code == 0
    for word in ("diff", "verify"):
        ran = bench.run(f"{word} {file} --format github")
        assert (ran.code, ran.stdout.count("::error ")) == (0, 0)


@heavy
def test_junit_gets_a_case_for_each_pdo_and_object(bench: Bench, file: Path) -> None:
    assert counted(bench.run(f"plan {file} --format junit").stdout) == (3, 0, 0)
    for word in ("diff", "verify"):
        assert counted(bench.run(f"{word} {file} --format junit").stdout) == (3, 2, 0)
    assert bench.run(f"apply {file}").code == 0
    for word in ("diff", "verify"):
        assert counted(bench.run(f"{word} {file} --format junit").stdout) == (3, 0, 0)
    assert counted(bench.run("verify --format junit").stdout)[1:] == (0, 0)


@heavy
def test_a_whole_device_has_a_case_for_each_setting_that_differs(bench: Bench) -> None:
    assert bench.run("backup monday.dcf").code == 0
    assert counted(bench.run("compare monday.dcf --format junit").stdout) == (1, 0, 0)
    for line in ("set tpdo1 --timer 20", "write 1017 650", "backup friday.dcf"):
        assert bench.run(line).code == 0
    ran = bench.run("compare monday.dcf --format github")
    assert (ran.code, ran.stdout.count("::error ")) == (3, 2)
    said = (
        "::error file=monday.dcf,title=node 1::0x1017:00 Producer heartbeat time of node 1: is 650 ms, expected 500 ms"
    )
    assert said in ran.stdout.splitlines()
    ran = bench.run("compare monday.dcf friday.dcf --format junit")
    assert (ran.code, counted(ran.stdout)) == (3, (3, 2, 0))
    assert 'name="friday.dcf"' in ran.stdout


def test_a_failure_leaves_no_report_empty(bench: Bench, file: Path) -> None:
    file.write_text(FILE.replace("event_timer", "event_tmer").replace("700", "-1"))
    lines = bench.run(f"plan {file} --format github").stdout.splitlines()
    assert [line.partition("title")[0] for line in lines] == [
        f"::error file={file},line=5,col=11,", f"::error file={file},line=9,col=25,",
    ]  # fmt: skip
    ran = bench.run(f"plan {file} --format junit")
    assert (ran.code, counted(ran.stdout)) == (4, (1, 0, 1))
    assert "2 errors. Nothing was sent. Further errors may show once these are corrected." in ran.stderr
    file.write_text("a: {node_id: 1, identity: {vendor: 9}}\nb: {node_id: 9}\n")
    ran = bench.run(f"verify {file} --format github")
    assert (ran.code, ran.stdout.count("::error title=")) == (6, 2)
    assert bench.run(f"apply {file} --format github").code == 2


SCRIPT = """# set up
read 1017
set tpdo1 --timer 20
map tpdo1 1018:1
store
"""


def test_a_script_has_a_case_for_each_line(bench: Bench) -> None:
    Path("setup.dvt").write_text(SCRIPT)
    ran = bench.run("run setup.dvt --format junit")
    suites = ET.fromstring(ran.stdout)  # noqa: S314 - our own
    assert (ran.code, dict(suites.attrib)) == (1, {"tests": "4", "failures": "1", "errors": "0"})
    (suite,) = suites
    assert [(one.attrib["name"], one.attrib["line"]) for one in suite] == [
        ("2: read 1017", "2"), ("3: set tpdo1 --timer 20", "3"), ("4: map tpdo1 1018:1", "4"), ("5: store", "5"),
    ]  # fmt: skip
    read, _, mapped, store = suite
    assert "0x1017:00" in (read[0].text or "")
    assert (mapped[0].tag, mapped[0].attrib["type"]) == ("failure", "rules")
    assert "is not mappable" in mapped[0].attrib["message"]
    assert [one.tag for one in store] == ["skipped"]
    assert "setup.dvt:4: error: TPDO1 not changed" in ran.stderr, "who looks on is told as ever"
    assert bench.run("read 1017").stdout.startswith("0x1017:00"), "the next line is shown as lines are"


def test_a_script_s_lines_are_annotated(bench: Bench) -> None:
    Path("setup.dvt").write_text(SCRIPT)
    lines = bench.run("run setup.dvt --format github --keep-going").stdout.splitlines()
    assert lines[:2] == ["::group::read 1017", lines[1]]
    assert lines[1].startswith("| 0x1017:00")
    assert sum(line.startswith("::error file=setup.dvt,line=4,title=map::TPDO1 not changed") for line in lines) == 1
    assert lines[-1] == "4 lines, 1 failed, 0 not reached"


def test_scripts_that_cannot_run_and_lines_that_are_secret(bench: Bench) -> None:
    Path("wrong.dvt").write_text("read 1017\nmapp tpdo1\n")
    ran = bench.run("run wrong.dvt --format github")
    assert (ran.code, ran.stdout.splitlines()[0]) == (
        2, "::error file=wrong.dvt,line=2,title=mapp::unknown command 'mapp'; did you mean 'map'? (exit code 2)",
    )  # fmt: skip
    assert counted(bench.run("run none.dvt --format junit").stdout) == (1, 1, 0)
    Path("inner.dvt").write_text("read 1017\nverify tpdo9\n")
    Path("outer.dvt").write_text("run inner.dvt\nread 1017\n")
    nested = bench.run("run outer.dvt --format junit").stdout
    assert counted(nested) == (4, 2, 0)
    assert [one.attrib["name"] for one in ET.fromstring(nested)] == ["outer.dvt", "inner.dvt"]  # noqa: S314
    Path("secret.dvt").write_text("write 5000:02 4711\n")
    secret = bench.run("run secret.dvt --format junit").stdout
    assert ('name="1: write"' in secret, "4711" in secret) == (True, False)
