"""One judge: every command that judges a network file reports the same rules of the same state, each with its place."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy
from tests.small_eds import communication, mapping, plain

JUDGES = ("check", "plan", "diff", "apply", "verify")
ON_THE_WAY = "plan", "apply"


class Broken(NamedTuple):
    """A network of gen4@1 and generic@5 in which *rule* is broken where § stands in what the file says."""

    rule: str
    marked: str
    is_error: bool = True

    @property
    def text(self) -> str:
        """What the file says."""
        return self.marked.replace("§", "")

    @property
    def place(self) -> tuple[int, int]:
        """Line and column of what breaks the rule."""
        ahead = self.marked[: self.marked.index("§")]
        return ahead.count("\n") + 1, len(ahead) - ahead.rfind("\n")


def one(node: str, body: str) -> str:
    """A file of one node, with the TPDOs of *body*."""
    node_id = {"gen4": 1, "generic": 5}[node]
    return f"a:\n  node_id: {node_id}\n  dcf: {node}\n  tpdo:\n      {body}\n"


def pair(tpdo: str, rpdo: str) -> str:
    """A file of both nodes: *tpdo* of node 1, and *rpdo* of node 5."""
    return f"a: {{node_id: 1, dcf: gen4, tpdo: {{{tpdo}}}}}\nb: {{node_id: 5, dcf: generic, rpdo: {{{rpdo}}}}}\n"


BROKEN = (
    Broken("mappable", one("gen4", "1: {event_timer: 50, mapping: [6041, §1018:01]}")),
    Broken("mappable", one("gen4", "3: {mapping: [§1018:01]}")),
    Broken("pdo-length", one("gen4", "3: {§mapping: [606C, 606C, 606C]}")),
    Broken("object-exists", one("gen4", "1: {mapping: [606C, §606C:07]}")),
    Broken("object-exists", one("gen4", "3: {mapping: [§606C:07]}")),
    Broken("can-id-restricted", one("generic", "1: {§cob_id: 0x601}")),
    Broken("can-id-clash", one("generic", "2: {enabled: true, §cob_id: 0x185}")),
    Broken("can-id-in-use", one("generic", "1: {§cob_id: 0x085}")),
    Broken("parameter-range", one("gen4", "1: {§event_timer: 65535}")),
    Broken("transmission-type", one("generic", "1: {§transmission: 245}")),
    Broken("frame-too-short", pair("1: {cob_id: 0x1A1, mapping: [6041]}",
                                   "§1: {cob_id: 0x1A1, mapping: [60FF, 6040]}")),
    Broken("layout", pair("1: {cob_id: 0x1A1, mapping: [6041, 606C]}", "§1: {cob_id: 0x1A1, mapping: [60FF, 6040]}")),
    Broken("heartbeat-too-short", "a: {node_id: 1, dcf: gen4, heartbeat_producer: 1000}\n"
           "§b: {node_id: 5, dcf: generic, heartbeat_consumer: {1: 100}}\n"),
    Broken("mapped-but-off", one("gen4", "§3: {mapping: [606C, 6041]}"), is_error=False),
    Broken("mapped-but-off", one("gen4", "§3: {event_timer: 50}"), is_error=False),
    Broken("unwatched-link", pair("1: {cob_id: 0x1A1, mapping: [606C, 6041]}",
                                  "§1: {cob_id: 0x1A1, mapping: [60FF, 6040]}"), is_error=False),
    Broken("unbounded-event-pdo", one("generic", "§1: {transmission: 255, event_timer: 0}"), is_error=False),
    Broken("asked-nothing", "§a: {node_id: 5, dcf: generic}\n", is_error=False),
)  # fmt: skip


@pytest.fixture
def both() -> Iterator[Bench]:
    """A drive and a device of CiA 301, as new."""
    with Bench(("gen4@1", "generic@5"), {"yes": True}) as made:
        yield made


def found(ran: Ran) -> set[tuple[str, str, int | None, int | None]]:
    """Rule, severity, line and column of all that *ran* reported as JSON, whatever it ended with."""
    document = ran.answer
    if "files" in document:
        said = [one for file in document["files"] for one in file["findings"]]
    elif "findings" in document:
        said = document["findings"]
    else:
        said = [one for node in document.get("nodes", ()) for one in node.get("findings", ())]
    return {(one["rule"], one["severity"], one["line"], one["column"]) for one in said}


@pytest.mark.parametrize("judge", JUDGES)
@pytest.mark.parametrize("broken", BROKEN, ids=[f"{one.rule}-{n}" for n, one in enumerate(BROKEN)])
def test_every_judge_reports_every_rule_with_its_place(broken: Broken, judge: str, both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(broken.text)
    ran = both.run(f"{judge} {path} --json")
    severity = "error" if broken.is_error else "warning"
    if broken.is_error:
        assert ran.code == (4 if judge == "check" else 1)
    elif judge not in ON_THE_WAY and judge != "check":
        assert ran.code in {0, 2, 3}  # `diff` and `verify` compare, and a warning keeps nothing from it
        return
    assert (broken.rule, severity, *broken.place) in found(ran), (found(ran), ran)


def hints(ran: Ran) -> set[tuple[str, str]]:
    """Rule and hint of all that *ran* reported with a hint as JSON, without the bus of commands."""
    document = ran.answer
    if "files" in document:
        said = [one for file in document["files"] for one in file["findings"]]
    elif "findings" in document:
        said = document["findings"]
    else:
        said = [one for node in document.get("nodes", ()) for one in node.get("findings", ())]
    return {(one["rule"], one["hint"]) for one in said if one["hint"]}


#: a synchronous PDO, of a file that says whether its master sends SYNC
SYNCHRONOUS = one("gen4", "1: {transmission: 1}")
HINTED = (
    *(broken.text for broken in BROKEN),
    SYNCHRONOUS,
    f"master: {{sync_period: 0}}\nnodes:\n{''.join(f'  {line}' for line in SYNCHRONOUS.splitlines(True))}",
    "nodes:\n  a: {node_id: 1, dcf: gen4, tpdo: {1: {cob_id: 0x1A1}}}\n"
    "  b: {node_id: 5, dcf: generic, rpdo: {1: {cob_id: 0x1A2}}}\nlinks: [{from: 'a:tpdo1', to: 'b:rpdo1'}]\n",
    "nodes:\n  a: {node_id: 1, dcf: gen4, tpdo: {1: {mapping: [6041, 6041]}}}\n"
    "  b: {node_id: 5, dcf: generic, rpdo: {1: {mapping: [6040]}}}\nlinks: [{from: 'a:tpdo1', to: 'b:rpdo1'}]\n",
)


@pytest.mark.parametrize("text", HINTED)
def test_check_and_plan_give_the_same_hints(text: str, both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(text)
    checked, planned = both.run(f"check {path} --json"), both.run(f"plan {path} --json")
    rules = {rule for rule, _, _, _ in found(planned)}
    assert {said for said in hints(checked) if said[0] in rules} == hints(planned)


def test_a_refusal_of_check_shows_its_hint(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(HINTED[-3])
    said = "name who sends SYNC: sync_period:"
    for command in ("check", "check --format github", "check --format junit", "check --format sarif", "plan"):
        ran = both.run(f"{command} {path}")
        assert ran.code
        assert "sync-not-produced" in ran.stdout + ran.stderr
        assert said in ran.stdout + ran.stderr, command


@pytest.mark.parametrize("master", ["baudrate: 250", "node_id: 127", "heartbeat_producer: 100, baudrate: 250"])
def test_a_master_without_a_sync_period_says_nothing_of_sync(master: str, both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(HINTED[-3].replace("sync_period: 0", master))
    checked, planned = both.run(f"check {path} --json"), both.run(f"plan {path} --json")
    assert (checked.code, planned.code) == (0, 0)
    for ran in (checked, planned):
        assert {("sync-from-elsewhere", "warning")} == {said[:2] for said in found(ran) if said[0].startswith("sync-")}


def test_nodes_without_settings_do_not_forbid_a_file(both: Bench, tmp_path: Path) -> None:
    """Node 1 has synchronous PDOs, but the file has nothing of it: the master's SYNC is its own matter."""
    path = tmp_path / "net.yaml"
    path.write_text(
        "master: {sync_period: 0}\nnodes:\n  a: {node_id: 1, dcf: tmcm}\n"
        "  b: {node_id: 5, dcf: generic, tpdo: {1: {event_timer: 50, inhibit_ms: 10}}}\n"
    )
    with Bench(("tmcm@1", "generic@5"), {"yes": True}) as bench:
        for command in ("check --all", "plan", "apply"):
            ran = bench.run(f"{command} {path}")
            assert ran.code == 0, ran
    assert "sync-not-produced" not in ran.stdout + ran.stderr


@pytest.mark.parametrize("judge", JUDGES)
def test_a_dcf_that_names_nothing_is_an_error_with_its_place(judge: str, both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text("a:\n  node_id: 1\n  dcf: gen4.ed\n  tpdo: {1: {event_timer: 50}}\n")
    ran = both.run(f"{judge} {path}{' --strict' if judge == 'check' else ''}")
    assert ran.code == 4
    assert f"{path}:3:8: error: there is no {tmp_path / 'gen4.ed'}" in ran.stderr
    assert "did you mean 'gen4'?" in ran.stderr
    assert ran.stderr.splitlines()[3].endswith("|        ^^^^^^^")


@pytest.mark.parametrize("judge", JUDGES)
def test_what_names_no_profile_and_no_device_file_is_an_error_with_its_place(
    judge: str, both: Bench, tmp_path: Path
) -> None:
    (tmp_path / "text.eds").write_text("hello\n")
    (tmp_path / "text.xdd").write_text("<ISO15745ProfileContainer>\n<x>\n")
    (tmp_path / "folder").mkdir()
    path = tmp_path / "net.yaml"
    path.write_text(
        "a: {node_id: 1, dcf: text.eds, profile: gen5}\nb: {node_id: 5, dcf: folder}\nc: {node_id: 6, dcf: text.xdd}\n"
    )
    ran = both.run(f"{judge} {path} --json")
    complaints = found_complaints(ran)
    assert (ran.code, [place for *place, _ in complaints]) == (4, [[1, 22], [1, 41], [2, 22], [3, 22]])
    assert "text.eds is not an EDS or DCF file: it has no section" in complaints[0][2]
    assert complaints[1][2] == "unknown profile 'gen5'; did you mean 'gen4'?"
    assert complaints[2][2].startswith(f"{tmp_path / 'folder'} is a folder, and dcf names a file")
    assert "text.xdd:3" in complaints[3][2]


def found_complaints(ran: Ran) -> list[tuple[int, int, str]]:
    """Line, column and text of each complaint about the file."""
    said = ran.answer
    rows = said["complaints"] if "complaints" in said else said["files"][0]["findings"]
    return [(row["line"], row["column"], row["text"]) for row in rows]


@pytest.mark.parametrize(("marked", "name"), [("identity: {§vendor: 5}", "vendor"), ("§product_code: 7", "product")])
def test_an_identity_that_the_node_does_not_have_is_said_at_its_key(
    marked: str, name: str, both: Bench, tmp_path: Path
) -> None:
    path = tmp_path / "net.yaml"
    text = f"a:\n  node_id: 1\n  dcf: gen4\n  {marked}\n"
    path.write_text(text.replace("§", ""))
    (row,) = (
        row for row in both.run(f"check {path} --json").document["files"][0]["findings"] if row["rule"] == "identity"
    )
    assert (row["line"], row["column"]) == (4, marked.index("§") + 3)
    assert f"its {name} is" in row["text"]


def test_no_finding_names_its_node_or_object_twice(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    for keys in ("tpdo: {9: {event_timer: 5}}", "sdo: [{index: 0x1018, sub_index: 1, value: 3}]"):
        path.write_text(f"a: {{node_id: 1, dcf: gen4, {keys}}}\n")
        for _, _, text in found_complaints(both.run(f"check {path} --json")):
            assert text.count("node 1") <= 1, text
            assert text.count("1018:01") <= 1, text


@pytest.mark.parametrize(
    ("keys", "hints"),
    [
        ("tpdo: {1: {cob_id: 0x1A5, enabled: true}, 2: {cob_id: 0x1A5, enabled: true}}",
         ["`enabled: false` of tpdo2, take another CAN-ID, or `cob_id: auto`",
          "`enabled: false` of tpdo1, take another CAN-ID, or `cob_id: auto`"]),
        ("tpdo: {1: {cob_id: 0x601, enabled: true}}",
         ["choose a CAN-ID within 0x181..0x57F or 0x680..0x6DF, or `cob_id: auto`"]),
        ("tpdo: {1: {mapping: [], enabled: true}}", ["`mapping:` of tpdo1, or `enabled: false`"]),
        ("tpdo: {1: {transmission: 253, rtr_allowed: false}}", ["`rtr_allowed: true`, or another type"]),
    ],
)  # fmt: skip
def test_what_helps_is_said_in_keys_of_the_file(keys: str, hints: list[str], both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(f"a: {{node_id: 5, dcf: generic, {keys}}}\n")
    for judge in ON_THE_WAY:
        ran = both.run(f"{judge} {path}")
        assert re.findall(r"^  hint    (.*)$", ran.stderr, re.MULTILINE) == hints


def test_a_dcf_is_found_beside_the_file_by_the_name_of_its_folder(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text('a: {node_id: 5, dcf: "@BUS_CONFIG_PATH@/own.eds", tpdo: {1: {event_timer: 50}}}\n')
    assert both.run(f"check {path}").code == 4
    assert both.run(f"export 5 {tmp_path / 'own.eds'}").code in {0, 2}
    (tmp_path / "own.eds").write_bytes((Path(__file__).parents[4] / "dvtcli/families/generic/generic.eds").read_bytes())
    assert both.run(f"check {path}").code == 0


def test_of_nodes_without_a_dcf_it_is_said_once_that_rules_were_skipped(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text("a: {node_id: 7, tpdo: {1: {event_timer: 5}}}\nb: {node_id: 8, tpdo: {1: {event_timer: 5}}}\n")
    (note,) = both.run(f"check {path} --json").document["files"][0]["notes"]
    assert (note["line"], note["column"]) == (1, 1)
    assert note["text"].startswith("nodes 7 and 8: no EDS, so rules that need an EDS were skipped")


MANY = """\
nodes:
  a:
    node_id: 1
    dcf: gen4
    tpdo:
      1: {event_timer: 50, mapping: [nothing_like_it]}
      2: {event_timer: 50, mapping: ['1018:01']}
      3: {event_timer: 50, mapping: [606C, 606C, 606C]}
  b:
    node_id: 5
    dcf: generic
    tpdo:
      1: {cob_id: 0x601}
      2: {mapping: ['6041:07']}
"""
#: the lines of `MANY` in which something is wrong
WRONG_LINES = [6, 7, 8, 13, 14]


@pytest.mark.parametrize("judge", JUDGES)
def test_all_errors_of_all_nodes_come_in_one_pass(judge: str, both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "many.yaml"
    path.write_text(MANY)
    ran = both.run(f"{judge} {path}")
    text = ran.stdout + ran.stderr
    assert ran.code == 4
    for number in WRONG_LINES:
        place = next(line for line in text.splitlines() if line.startswith(f"{path}:{number}:") and "error: " in line)
        behind = text.splitlines()[text.splitlines().index(place) :]
        column = int(place.split(":")[2])
        caret = next(line for line in behind if set(line.strip()) <= set("|^ "))
        assert caret.index("^") == len(f"{'':5} | ") + column - 1


def test_formats_for_ci_carry_line_and_column(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(one("gen4", "3: {mapping: [606C, 606C, 606C]}"))
    assert f"file={path},line=5,col=11," in both.run(f"check {path} --format github").stdout
    sarif = json.loads(both.run(f"check {path} --format sarif").stdout)["runs"][0]["results"]
    region = next(one for one in sarif if one["ruleId"] == "pdo-length")["locations"][0]["physicalLocation"]["region"]
    assert (region["startLine"], region["startColumn"]) == (5, 11)
    suites = ET.fromstring(both.run(f"check {path} --format junit").stdout)  # noqa: S314 - our own
    case = next(one for one in suites.iter("testcase") if one.attrib["name"] == "pdo-length")
    assert f"{path}:5:11: error: " in (case.findtext("failure") or "")


def test_what_is_said_of_pdos_that_the_file_does_not_name_is_counted(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text("a: {node_id: 1, dcf: gen4, tpdo: {3: {enabled: false}}}\n")
    ran, shown = (both.run(f"check {path} --strict --without unknown-bit-rate{more} --json") for more in ("", " --all"))
    (file,), (whole,) = ran.document["files"], shown.document["files"]
    assert (ran.code, shown.code) == (0, 0), "they do not count for --strict, shown or not"
    assert (file["findings"], file["folded"], whole["folded"]) == ([], len(whole["findings"]), 0)
    assert file["folded"] > 1
    assert {one["pdo"] for one in whole["findings"]} == {"tpdo1", "tpdo2", "rpdo2"}
    assert (
        f"; {file['folded']} more about PDOs that it does not name (--all shows them)"
        in both.run(f"check {path}").stdout
    )


def test_an_error_of_a_pdo_that_the_file_does_not_name_is_not_folded(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(
        "a: {node_id: 1, dcf: gen4, rpdo: {1: {enabled: true, cob_id: 0x185, mapping: [60FF, 60FF]}}}\n"
        "b: {node_id: 5, dcf: generic, heartbeat_producer: 100}\n"
    )
    ran = both.run(f"check {path} --json")
    assert ran.code == 4
    assert {"error"} <= {one["severity"] for one in ran.document["files"][0]["findings"]}


#: what breaks a rule of one device: the COB-ID and the mapping of a TPDO, and what the rule says
ODD_PDOS = (
    pytest.param("0x102", ["0x60000008"], "can-id-reserved", id="reserved CAN-ID"),
    pytest.param("$NODEID+0x280", ["0x60000010"], "entry-length", id="length of an entry"),
    pytest.param("$NODEID+0x280", ["0x60000008", "0x60010010"] * 3, "too-long", id="72 bits"),
)


@heavy
@pytest.mark.parametrize(("cob_id", "entries", "rule"), ODD_PDOS)
def test_what_a_device_holds_against_a_rule_is_a_warning_until_it_is_changed(
    cob_id: str, entries: list[str], rule: str, tmp_path: Path
) -> None:
    """A maker's device may hold what the standard reserves: a file that leaves it alone does nothing wrong."""
    eds = plain()
    eds.record(0x1801, "TPDO2", communication(cob_id))
    eds.record(0x1A01, "TPDO2 mapping", mapping(len(entries), entries))
    (tmp_path / "odd.eds").write_text(eds.text(), encoding="utf-8")
    file = tmp_path / "net.yaml"
    with Bench((f"{tmp_path / 'odd.eds'}@5",), {"yes": True}) as bench:
        assert bench.run(f"import {file}").code == 0
        for judge in ("plan", "apply", "verify"):
            ran = bench.run(f"{judge} {file} --json")
            assert ran.code == 0, (judge, ran)
        assert (rule, "warning") in {(each[0], each[1]) for each in found(bench.run(f"plan {file} --json"))}
        held = file.read_text("utf-8")
        odd = re.sub(r"(\n +2:\n(?:.*\n)*? +event_timer: )\d+", r"\g<1>70", held)
        assert odd != held
        file.write_text(odd, encoding="utf-8")
        refused = bench.run(f"apply {file} --json")
        assert refused.code == 1, refused
        assert "error" in {each[1] for each in found(refused)}


def test_a_warning_of_what_is_mapped_and_off_is_an_error_with_strict(both: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(one("gen4", "3: {event_timer: 50, mapping: [606C, 6041]}"))
    assert both.run(f"check {path} --rule mapped-but-off").code == 0
    assert both.run(f"check {path} --rule mapped-but-off --strict").code == 4
    for word in ("enabled: true", "enabled: false"):
        path.write_text(one("gen4", f"3: {{{word}, event_timer: 50, mapping: [606C, 6041]}}"))
        assert "mapped-but-off" not in both.run(f"check {path}").stdout
        assert "stays off" not in both.run(f"plan {path}").stderr
    path.write_text(one("gen4", "1: {event_timer: 50}"))
    assert "mapped-but-off" not in both.run(f"check {path}").stdout, "it is on"


WORDS = st.sampled_from(["6041", "606C", "6040", "60FF", "1018:01", "6064", "6041:07", "dummy/8", "6061", "1001"])
CAN_IDS = st.sampled_from([0x181, 0x185, 0x1A1, 0x085, 0x080, 0x601, 0x201, 0x301, 0x7E5, 0x701])


@st.composite
def pdo_keys(draw: st.DrawFn) -> dict[str, Any]:
    """Some keys of a PDO, right and wrong."""
    keys: dict[str, Any] = {}
    if draw(st.booleans()):
        keys["enabled"] = draw(st.booleans())
    if draw(st.booleans()):
        keys["cob_id"] = draw(CAN_IDS)
    if draw(st.booleans()):
        keys["mapping"] = draw(st.lists(WORDS, min_size=1, max_size=4))
    if draw(st.booleans()):
        keys["transmission"] = draw(st.sampled_from([0, 1, 240, 245, 253, 254, 255]))
    return keys


@st.composite
def network_files(draw: st.DrawFn) -> dict[str, Any]:
    """A network file of both nodes, as JSON, which is YAML."""
    numbers = st.dictionaries(st.sampled_from(["1", "2", "3"]), pdo_keys(), max_size=2)
    nodes: dict[str, Any] = {}
    for name, node_id, family in (("a", 1, "gen4"), ("b", 5, "generic")):
        nodes[name] = {"node_id": node_id, "dcf": family, "tpdo": draw(numbers), "rpdo": draw(numbers)}
    return {"nodes": nodes}


def errors(ran: Ran) -> set[tuple[str, int | None, int | None]]:
    return {(rule, line, column) for rule, severity, line, column in found(ran) if severity == "error"}


@settings(max_examples=max(3, settings().max_examples // 3), deadline=None)
@given(network_files())
def test_check_and_plan_agree_on_errors(file: dict[str, Any]) -> None:
    """Offline, by the EDS of a family, and with nodes as new from it."""
    path = Path("drawn.yaml")
    path.write_text(f"# drawn\n{json.dumps(file, indent=1)}\n")
    with Bench(("gen4@1", "generic@5")) as bench:
        planned, checked = bench.run(f"plan {path} --json"), bench.run(f"check {path} --json")
    assert errors(planned) == errors(checked), path.read_text()
    assert (planned.code != 0) == (checked.code != 0)
