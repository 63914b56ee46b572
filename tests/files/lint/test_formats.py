"""`eds check` in every format, with the exit codes, as a process would run it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from tests.files.lint.sample import SOUND, line_of
from tests.process import Ran, run

FAULTY = (
    SOUND.replace("HighLimit=500", "HighLimit=99")
    .replace("LSS_Supported=0", "LSS_Supported=yes")
    .replace("EDSVersion=4.0", "EDSVersion=404")
)
WARNED = SOUND.replace("LSS_Supported=0", "LSS_Supported=yes")
NOTED = SOUND.replace("EDSVersion=4.0", "EDSVersion=404")
LINE = line_of(FAULTY, "DefaultValue=100\n")
ROW = "2000:00 INTEGER16: DefaultValue 100 (0x64) is above HighLimit 99 (0x63)"


def check(folder: Path, text: str, *words: str) -> Ran:
    (folder / "pump.eds").write_bytes(text.replace("\n", "\r\n").encode())
    return run(["eds", "check", "pump.eds", *words], cwd=folder)


@pytest.mark.drawn(15)
@pytest.mark.parametrize(
    ("text", "words", "code"),
    [
        (SOUND, ("--strict",), 0),
        (NOTED, ("--strict",), 0),
        (WARNED, (), 0),
        (WARNED, ("--strict",), 4),
        (WARNED, ("--strict", "--without", "flag-value"), 0),
        (FAULTY, (), 4),
        (FAULTY, ("--rule", "eds-version", "--rule", "flag-value"), 0),
        (FAULTY, ("--rule", "flag-value", "--strict"), 4),
        (FAULTY, ("--rule", "no-such"), 2),
        (FAULTY, ("--without", "no-such"), 2),
        (FAULTY, ("--rule", "half-pdo", "--without", "half-pdo"), 2),
    ],
)
@pytest.mark.parametrize("format_name", ["text", "json", "github", "junit", "sarif"])
def test_the_exit_code_says_whether_the_file_is_bad(
    tmp_path: Path, text: str, words: tuple[str, ...], code: int, format_name: str
) -> None:
    assert check(tmp_path, text, *words, "--format", format_name).returncode == code


def test_text_has_place_severity_rule_and_a_summary_of_rules(tmp_path: Path) -> None:
    lines = check(tmp_path, FAULTY).stdout.splitlines()
    assert f"pump.eds:{LINE}: error: {ROW} [default-outside-limits]" in lines
    assert "  1  error    default-outside-limits  DefaultValue is below LowLimit or above HighLimit" in lines
    assert lines[-1].endswith("rules: 1 error, 1 warning, 1 note")


def test_a_rule_that_speaks_often_is_cut_short_unless_it_is_asked_alone(tmp_path: Path) -> None:
    colours = "".join(f"Colour{letter}=1\n" for letter in "ABCDEFGHIJKLMNOP")
    many = SOUND.replace("HighLimit=500\n", f"HighLimit=500\n{colours}")
    short = check(tmp_path, many).stdout
    assert short.count("[unknown-key]") == 10
    assert "10 shown, --rule unknown-key shows all" in short
    assert check(tmp_path, many, "--rule", "unknown-key").stdout.count("[unknown-key]") == 16


def test_findings_of_one_cause_are_one_line_with_their_number(tmp_path: Path) -> None:
    many = SOUND.replace("=0x60000008", "=0x50000008").replace("=0x60010010", "=0x50000108")
    (line,) = [line for line in check(tmp_path, many).stdout.splitlines() if "[object-exists]" in line]
    first, second = (many[: many.index(word)].count("\n") + 1 for word in ("0x50000008", "0x50000108"))
    assert line == (
        f"pump.eds:{first}: error: 1A00:01 UNSIGNED32: 0x5000 is not in pump.eds (2 times: also line {second}) "
        "[object-exists]"
    )
    alone = check(tmp_path, many, "--rule", "object-exists").stdout
    assert alone.count("[object-exists]") == 2
    assert len(json.loads(check(tmp_path, many, "--json").stdout.splitlines()[0])["findings"]) == 2


def test_json_names_the_rule_and_the_object(tmp_path: Path) -> None:
    document, error = map(json.loads, check(tmp_path, FAULTY, "--json").stdout.splitlines())
    assert (error["exit_code"], error["text"]) == (4, f"{document['file']} has 1 finding")
    assert document["count"] == {"error": 1, "warning": 1, "note": 1}
    assert document["findings"][-1] == {
        "line": LINE, "column": 14, "end_column": 16, "severity": "error", "rule": "default-outside-limits",
        "object": "2000:00", "text": ROW,
    }  # fmt: skip
    assert document["findings"][0]["object"] is None


def test_github_gets_a_command_for_each_finding_errors_first(tmp_path: Path) -> None:
    lines = check(tmp_path, FAULTY, "--format", "github").stdout.splitlines()
    assert lines[0] == f"::error file=pump.eds,line={LINE},col=14,endColumn=16,title=default-outside-limits::{ROW}"
    assert [line.split()[0] for line in lines[:3]] == ["::error", "::warning", "::notice"]
    assert lines[3:] == ["pump.eds: 1 error, 1 warning, 1 note"]


def test_github_commands_are_escaped(tmp_path: Path) -> None:
    odd = SOUND.replace("LSS_Supported=0", "LSS_Supported=50%,a:b")
    (line, _) = check(tmp_path, odd, "--format", "github").stdout.splitlines()
    assert line.endswith("::LSS_Supported=50%25,a:b is neither 0 nor 1")


#: what the public schema requires of each part, and of which kind it is (SARIF 2.1.0, 3.13 to 3.58)
REQUIRED: dict[str, dict[str, type]] = {
    "log": {"version": str, "runs": list},
    "run": {"tool": dict, "results": list},
    "driver": {"name": str, "rules": list},
    "rule": {"id": str},
    "result": {"message": dict, "ruleId": str, "ruleIndex": int, "level": str, "locations": list},
}


def has(part: dict[str, Any], kind: str) -> None:
    for key, wanted in REQUIRED[kind].items():
        assert isinstance(part[key], wanted), (kind, key)


def test_sarif_has_what_its_schema_requires(tmp_path: Path) -> None:
    log = json.loads(check(tmp_path, FAULTY, "--format", "sarif").stdout)
    has(log, "log")
    (one,) = log["runs"]
    has(one, "run")
    driver = one["tool"]["driver"]
    has(driver, "driver")
    assert log["version"] == "2.1.0"
    for rule in driver["rules"]:
        has(rule, "rule")
        assert rule["shortDescription"]["text"]
        assert rule["defaultConfiguration"]["level"] in ("error", "warning", "note")
    assert len({rule["id"] for rule in driver["rules"]}) == len(driver["rules"]) >= 100
    for result in one["results"]:
        has(result, "result")
        assert driver["rules"][result["ruleIndex"]]["id"] == result["ruleId"]
        assert result["level"] in ("none", "note", "warning", "error")
        place = result["locations"][0]["physicalLocation"]
        assert place["artifactLocation"]["uri"] == "pump.eds"
        assert place["region"]["startLine"] >= 1
    assert [(result["ruleId"], result["message"]["text"]) for result in one["results"]][-1] == (
        "default-outside-limits", ROW,
    )  # fmt: skip


def test_sarif_of_a_path_with_blanks_is_a_reference(tmp_path: Path) -> None:
    folder = tmp_path / "a b"
    folder.mkdir()
    (folder / "pump.eds").write_bytes(NOTED.encode())
    done = run(["eds", "check", "a b/pump.eds", "--format", "sarif"], cwd=tmp_path)
    assert json.loads(done.stdout)["runs"][0]["artifacts"] == [{"location": {"uri": "a%20b/pump.eds"}}]
    whole = run(["eds", "check", str(folder / "pump.eds"), "--format", "sarif"], cwd=tmp_path)
    assert json.loads(whole.stdout)["runs"][0]["artifacts"][0]["location"]["uri"].startswith("file:///")


def test_junit_has_a_case_for_each_rule_and_fails_where_the_exit_code_does(tmp_path: Path) -> None:
    for words, failing in (((), ["default-outside-limits"]), (("--strict",), ["flag-value", "default-outside-limits"])):
        suites = ET.fromstring(check(tmp_path, FAULTY, *words, "--format", "junit").stdout.partition("?>")[2])  # noqa: S314
        cases = suites.findall("testsuite/testcase")
        assert int(suites.attrib["tests"]) == len(cases) >= 100
        failed = {case.attrib["name"]: case.find("failure") for case in cases if case.find("failure") is not None}
        assert set(failed) == set(failing)
        assert int(suites.attrib["failures"]) == len(failing)
        (noted,) = (case for case in cases if case.attrib["name"] == "eds-version")
        assert "EDSVersion=404" in (noted.findtext("system-out") or "")


@pytest.mark.parametrize("words", ["pdo --sim gen4", "eds show pump.eds", "map tpdo1 6041 --sim gen4"])
@pytest.mark.parametrize("format_name", ["github", "junit", "sarif"])
def test_other_commands_refuse_these_formats_before_they_do_anything(
    tmp_path: Path, words: str, format_name: str
) -> None:
    (tmp_path / "pump.eds").write_bytes(SOUND.encode())
    done = run([*words.split(), "--format", format_name], cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")


def test_what_is_no_eds_is_an_error_on_stderr_in_every_format(tmp_path: Path) -> None:
    for format_name, told in (("github", "::error "), ("junit", "<error "), ("sarif", "")):
        done = check(tmp_path, "hello\n", "--format", format_name)
        assert (done.returncode, bool(done.stdout)) == (4, bool(told))
        assert told in done.stdout
        assert "not an EDS" in done.stderr


def test_the_prompt_and_scripts_take_them_for_their_line(tmp_path: Path) -> None:
    (tmp_path / "pump.eds").write_bytes(NOTED.replace("\n", "\r\n").encode())
    done = run([], stdin="eds check pump.eds --format github\neds show pump.eds\n", cwd=tmp_path)
    assert done.returncode == 0, done
    assert done.stdout.startswith("::notice file=pump.eds,line=5,col=12,endColumn=14,title=eds-version::")
    assert "vendor        Example" in done.stdout


# --- several files, families, columns


def several(folder: Path, *words: str) -> Ran:
    """A right file, a faulty one, one with a warning and one that is no EDS at all, checked at once."""
    texts = {"a.eds": SOUND, "b.eds": FAULTY, "c.eds": WARNED, "d.eds": "hello\n"}
    for name, text in texts.items():
        (folder / name).write_bytes(text.replace("pump.eds", name).replace("\n", "\r\n").encode())
    return run(["eds", "check", *words], cwd=folder)


def test_several_files_are_checked_each_and_summed_up(tmp_path: Path) -> None:
    done = several(tmp_path, "a.eds", "b.eds", "c.eds", "d.eds")
    assert (done.returncode, done.stderr) == (4, "")
    lines = done.stdout.splitlines()
    sums = [line for line in lines if ".eds: " in line and " sections, " in line]
    assert [line.partition(":")[0] for line in sums] == ["a.eds", "b.eds", "c.eds", "d.eds"]
    assert any(line.startswith("d.eds:1: error: ") and line.endswith("[unreadable]") for line in lines)
    assert lines[-1] == "4 files, 2 of them invalid: 2 errors, 2 warnings, 1 note"
    assert several(tmp_path, "a.eds", "c.eds").returncode == 0
    assert several(tmp_path, "a.eds", "c.eds", "--strict").returncode == 4


def test_a_pattern_stands_for_the_files_that_it_matches(tmp_path: Path) -> None:
    done = several(tmp_path, "[bc].eds", "b.*", "--json")
    document, error = map(json.loads, done.stdout.splitlines())
    assert (error["exit_code"], error["text"]) == (4, "b.eds has 1 finding")
    assert (document["schema"], document["bad"]) == ("dvtcli.eds-files/1", 1)
    assert [one["file"] for one in document["files"]] == ["b.eds", "c.eds"]
    assert document["count"] == {"error": 1, "warning": 2, "note": 1}
    one = several(tmp_path, "a*.eds", "--json")
    assert json.loads(one.stdout)["schema"] == "dvtcli.eds/1", "one file is answered as ever"
    done = several(tmp_path, "x*.eds")
    assert (done.returncode, done.stdout) == (2, "")
    (tmp_path / "[b].eds").write_bytes(SOUND.encode())
    assert json.loads(several(tmp_path, "[b].eds", "--json").stdout)["file"] == "[b].eds", "a name is a name first"


def test_one_file_is_shown(tmp_path: Path) -> None:
    (tmp_path / "a.eds").write_bytes(SOUND.encode())
    done = run(["eds", "show", "a.eds", "a.eds"], cwd=tmp_path)
    assert (done.returncode, "takes one file" in done.stderr) == (2, True)


def test_other_formats_have_all_files(tmp_path: Path) -> None:
    lines = several(tmp_path, "*.eds", "--format", "github").stdout.splitlines()
    assert [line.split()[0] for line in lines[:5]] == ["::error", "::error", "::warning", "::warning", "::notice"]
    assert [line.partition(":")[0] for line in lines[5:]] == ["a.eds", "b.eds", "c.eds", "d.eds"]
    (sarif,) = json.loads(several(tmp_path, "*.eds", "--format", "sarif").stdout)["runs"]
    assert [one["location"]["uri"] for one in sarif["artifacts"]] == ["a.eds", "b.eds", "c.eds", "d.eds"]
    rules = [rule["id"] for rule in sarif["tool"]["driver"]["rules"]]
    assert all(rules[one["ruleIndex"]] == one["ruleId"] for one in sarif["results"])
    suites = ET.fromstring(several(tmp_path, "*.eds", "--format", "junit").stdout.partition("?>")[2])  # noqa: S314
    assert [suite.attrib["name"] for suite in suites] == [f"eds check {name}.eds" for name in "abcd"]
    assert suites.attrib["failures"] == "2"
    (unread,) = (suite for suite in suites if suite.attrib["name"] == "eds check d.eds")
    assert unread.attrib["tests"] == "1", "a rule that could not look has not passed"


@pytest.mark.parametrize("format_name", ["text", "json", "github", "junit", "sarif"])
@pytest.mark.parametrize("name", ["missing.eds", "x*.eds", "."])
def test_one_that_is_not_there_keeps_no_other_from_being_checked(tmp_path: Path, format_name: str, name: str) -> None:
    done = several(tmp_path, "b.eds", name, "--format", format_name)
    assert (done.returncode, done.stderr) == (4, "")
    assert all(said in done.stdout for said in ("default-outside-limits", name, "unreadable"))


def test_a_finding_has_the_columns_of_its_value(tmp_path: Path) -> None:
    text = SOUND.replace("EDSVersion=4.0", "  EDSVersion = 404  ").replace("[2000]", "[2000] odd\n  Shade = 3")
    found = {one["rule"]: one for one in json.loads(check(tmp_path, text, "--json").stdout)["findings"]}
    assert (found["eds-version"]["column"], found["eds-version"]["end_column"]) == (16, 18)
    assert (found["bad-header"]["column"], found["bad-header"]["end_column"]) == (1, 10)
    assert (found["unknown-key"]["column"], found["unknown-key"]["end_column"]) == (3, 7), "the key is what is odd"
    lines = check(tmp_path, text, "--format", "github").stdout.splitlines()
    (line,) = [line for line in lines if "title=eds-version" in line]
    assert ",col=16,endColumn=18,title=" in line
    (sarif,) = json.loads(check(tmp_path, text, "--format", "sarif").stdout)["runs"]
    (one,) = [one for one in sarif["results"] if one["ruleId"] == "eds-version"]
    region = one["locations"][0]["physicalLocation"]["region"]
    assert (region["startColumn"], region["endColumn"]) == (16, 19), "the end is the column after it"


def test_pdos_are_judged_as_on_a_device_of_the_family(tmp_path: Path) -> None:
    section = SOUND[SOUND.index("[6000]") : SOUND.index("[6001]")]
    text = SOUND.replace(section, section.replace("AccessType=ro", "AccessType=rw"))
    assert "[read-write-object]" not in check(tmp_path, text).stdout
    assert "[read-write-object]" in check(tmp_path, text, "-p", "tmcm").stdout
    assert check(tmp_path, text, "-p", "nobody").returncode == 2
