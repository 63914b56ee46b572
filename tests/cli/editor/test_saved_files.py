"""Files that `edit FILE` saves: what changes, what stays byte for byte, and what is refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.editor.edit_loop import FileNodes, simulated_nodes
from dvtcli.cli.screen.full_screen import in_a_line
from dvtcli.cli.view.output import Output
from dvtcli.domain.network.network_config import Endpoint, LinkConfig, PartialPdoConfig
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import UsageError
from dvtcli.files.network.read_network import read_network_file
from dvtcli.operations.exchange.edit_file import file_to_edit
from tests.process import run

EXAMPLES = Path(__file__).parents[3] / "examples"
NETWORK = """nodes:
  b:
    node_id: 2
    dcf: gen4
    heartbeat_producer: 700
  a:
    node_id: 1
    dcf: gen4
    rpdo:
      1: {enabled: false}
"""


class Answers(Conversation):
    """A conversation that keeps the questions and answers yes."""

    def __init__(self) -> None:
        super().__init__(Output())
        self.questions: list[str] = []

    def consent(self, question: str | Callable[[], str], **_more: object) -> None:
        self.questions.append(question if isinstance(question, str) else question())


@contextmanager
def edited(file: Path) -> Iterator[tuple[Answers, FileNodes]]:
    """The nodes of *file*, the first PDO of the first node with another event timer."""
    with unedited(file) as (session, nodes):
        edit(nodes)
        yield session, nodes


def edit(nodes: FileNodes, node_id: int | None = None) -> tuple[Pdo, int]:
    pdos = nodes.editor(node_id).pdos
    pdo, config = next((pdo, pdos.now[pdo]) for pdo in sorted(pdos.now, key=lambda pdo: not pdo.is_tpdo)
                       if pdos.now[pdo].communication.event_timer is not None)  # fmt: skip
    timer = (config.communication.event_timer or 0) + 7
    pdos.put(pdo, config.with_parameters(event_timer=timer))
    return pdo, timer


@contextmanager
def unedited(file: Path) -> Iterator[tuple[Answers, FileNodes]]:
    session, opened = Answers(), file_to_edit(str(file))
    with simulated_nodes(session, opened) as inner:
        yield session, FileNodes(inner, opened)


def network(folder: Path, text: str = NETWORK) -> Path:
    file = folder / "net.yaml"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    assert run(("--sim", "gen4@9", "export", "n.dcf"), cwd=folder).returncode == 0
    return folder / "n.dcf"


@pytest.fixture
def dcf(tmp_path: Path, exported: Path) -> Path:
    """A DCF of another maker: a bit rate, no serial number, an original EDS, a line that nobody reads."""
    lines = exported.read_bytes().decode("latin-1").splitlines()
    kept = [line for line in lines if not line.startswith(("LSS_SerialNumber", "LastEDS", "ModifiedBy", "Baudrate"))]
    at = kept.index("[DeviceComissioning]")
    kept[at + 1 : at + 1] = ["Baudrate=250", "; as the machine's builder wants it"]
    file = tmp_path / "x.dcf"
    file.write_bytes("\r\n".join([*kept, ""]).encode("latin-1"))
    return file


@pytest.fixture(scope="module")
def exported_xdc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported_xdc")
    assert run(("--sim", "gen4@9", "export", "n.xdc"), cwd=folder).returncode == 0
    return folder / "n.xdc"


@pytest.fixture
def xdc(tmp_path: Path, exported_xdc: Path) -> Path:
    """An XDC with lines of Windows, and a comment that nobody reads."""
    file = tmp_path / "x.xdc"
    lines = exported_xdc.read_text(encoding="utf-8").splitlines()
    file.write_bytes("\r\n".join([*lines, "<!-- as the machine's builder wants it -->", ""]).encode())
    return file


#: examples without an EDS of a node: `edit` says so
NOT_EDITED = {"stamped.yaml", "traction.yaml"}


@pytest.mark.parametrize(
    "name", sorted({str(path.relative_to(EXAMPLES)) for path in EXAMPLES.rglob("*.yaml")} - NOT_EDITED)
)
def test_every_example_that_opens_is_saved(tmp_path: Path, name: str) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    file = tmp_path / "examples" / name
    before = file.read_bytes()
    with unedited(file) as (session, nodes):
        assert nodes.save(session, str(file)) == f"nothing to write: {file} already has these values"
        assert file.read_bytes() == before
        pdo, timer = edit(nodes)
        node_id = nodes.nodes[0][0]
        assert nodes.save(session, str(file)) == f"{file}: {node_id}:{pdo} written"
    config = read_network_file(file)
    node = next(node for node in config.nodes if node.node_id == node_id)
    assert next(one for one in node.pdos if one.pdo == pdo).event_timer == timer


THEIRS = {"yaml": b"# theirs\n", "dcf": b"; theirs\r\n", "xdc": b"<!-- theirs -->"}


@pytest.mark.parametrize("kind", ["yaml", "dcf", "xdc"])
def test_what_another_program_wrote_meanwhile_is_not_overwritten(
    tmp_path: Path, dcf: Path, xdc: Path, kind: str
) -> None:
    file = {"dcf": dcf, "xdc": xdc}.get(kind) or network(tmp_path)
    with edited(file) as (session, nodes):
        theirs = file.read_bytes() + THEIRS[kind]
        file.write_bytes(theirs)
        with pytest.raises(UsageError, match="was changed by another program and is not overwritten") as refused:
            nodes.save(session, str(file))
        assert "F2" in str(refused.value.hint)
        assert not session.questions
        assert file.read_bytes() == theirs
        other = tmp_path / f"other.{kind}"
        assert "written" in (nodes.save(session, str(other)) or "")
        assert b"theirs" not in other.read_bytes()


def test_what_is_written_while_the_question_is_open_is_not_overwritten(tmp_path: Path) -> None:
    file = network(tmp_path)

    class Meanwhile(Answers):
        def consent(self, question: str | Callable[[], str], **_more: object) -> None:
            file.write_text(NETWORK.replace("700", "900"), encoding="utf-8")

    with (
        edited(file) as (_session, nodes),
        pytest.raises(UsageError, match="was changed by another program and is not overwritten"),
    ):
        nodes.save(Meanwhile(), str(file))
    assert "900" in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["yaml", "dcf", "xdc"])
def test_ones_own_writing_is_not_taken_for_another_programs(tmp_path: Path, dcf: Path, xdc: Path, kind: str) -> None:
    file = {"dcf": dcf, "xdc": xdc}.get(kind) or network(tmp_path)
    with edited(file) as (session, nodes):
        nodes.save(session, str(file))
        first = file.read_bytes()
        nodes.save(session, str(file))
        assert file.read_bytes() == first


@pytest.mark.parametrize(("kind", "suffix"), [("yaml", "dcf"), ("yaml", "xdc"), ("dcf", "xdc"), ("xdc", "dcf")])
def test_values_that_only_a_simulated_node_has_are_not_written(
    tmp_path: Path, dcf: Path, xdc: Path, kind: str, suffix: str
) -> None:
    file, made = {"dcf": dcf, "xdc": xdc}.get(kind) or network(tmp_path), tmp_path / f"made.{suffix}"
    with edited(file) as (session, nodes):
        with pytest.raises(UsageError, match="it has the values of a whole device") as refused:
            nodes.save(session, str(made))
        said = in_a_line(session, refused.value)
        if kind == "yaml":  # no command: there is neither a bus nor a node in this call
            assert "a name in .yaml saves the network file" in said
            assert "`" not in said
        else:
            assert f"eds convert {file} {made}" in said
    assert not made.exists()


@pytest.mark.parametrize("to", ["x.dcf", "y.dcf"])
def test_only_the_edited_value_of_a_dcf_changes(tmp_path: Path, dcf: Path, to: str) -> None:
    before = dcf.read_bytes()
    with unedited(dcf) as (session, nodes):
        _pdo, timer = edit(nodes)
        nodes.save(session, str(tmp_path / to))
    after = (tmp_path / to).read_bytes()
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    assert len(old) == len(new)
    differing = [(was, now) for was, now in zip(old, new, strict=True) if was != now]
    assert [now for _was, now in differing] == [f"ParameterValue=0x{timer:04X}\r\n".encode()]


@pytest.mark.parametrize("to", ["x.xdc", "y.xdc"])
def test_only_the_edited_value_of_an_xdc_changes(tmp_path: Path, xdc: Path, to: str) -> None:
    before = xdc.read_bytes()
    with unedited(xdc) as (session, nodes):
        pdo, timer = edit(nodes)
        assert nodes.save(session, str(tmp_path / to)) == f"{tmp_path / to}: 9:{pdo} written"
    after = (tmp_path / to).read_bytes()
    old, new = before.split(b"\n"), after.split(b"\n")
    differing = [(was, now) for was, now in zip(old, new, strict=True) if was != now]
    assert len(differing) == 1
    assert f'actualValue="0x{timer:04X}"'.encode() in differing[0][1]
    with unedited(tmp_path / to) as (_session, nodes):
        assert nodes.editor(None).pdos.held[pdo].communication.event_timer == timer


@pytest.mark.parametrize("kind", ["yaml", "dcf", "xdc"])
def test_an_unedited_file_is_copied_byte_for_byte(tmp_path: Path, dcf: Path, xdc: Path, kind: str) -> None:
    file, copy = {"dcf": dcf, "xdc": xdc}.get(kind) or network(tmp_path), tmp_path / f"copy.{kind}"
    with unedited(file) as (session, nodes):
        assert nodes.save(session, str(copy)) == f"{copy}: a copy of {file}, without changes"
    assert copy.read_bytes() == file.read_bytes()


def test_a_file_with_what_a_node_refuses_names_both_and_says_that_no_device_was_touched(tmp_path: Path) -> None:
    file = network(tmp_path, "nodes:\n  a:\n    node_id: 7\n    dcf: gen4\n    tpdo:\n      3: {mapping: [1018:01]}\n")
    with pytest.raises(UsageError) as refused, unedited(file):
        pass
    assert f"{file} cannot be edited: node 7 refused" in refused.value.text
    assert "no device was touched" in refused.value.text
    assert refused.value.node == 7


def test_the_question_names_the_defaults_and_each_comment(tmp_path: Path) -> None:
    file = network(tmp_path, "defaults: {heartbeat_producer: 500}\n" + NETWORK.replace("700", "700  # slow # by far"))
    with edited(file) as (session, nodes):
        nodes.save(session, str(file))
    assert session.questions == [
        f"{file} exists; overwrite it, which loses 1 comment, the section `defaults`, which is copied into each node?"
    ]


@pytest.mark.parametrize(
    ("text", "lost"),
    [
        (".common: &c {dcf: gen4}\nnodes:\n  a: {<<: *c, node_id: 1}\n", "1 reference to anchors, copied out in full"),
        ("nodes:\n  a: {node_id: 1, dcf: &f gen4}\n  b: {node_id: 2, dcf: *f}\n  c: {node_id: 3, dcf: *f}\n",
         "2 references to anchors, copied out in full"),
    ],
)  # fmt: skip
def test_the_question_names_aliases(tmp_path: Path, text: str, lost: str) -> None:
    file = network(tmp_path, text)
    with edited(file) as (session, nodes):
        nodes.save(session, str(file))
    assert session.questions == [f"{file} exists; overwrite it, which loses {lost}?"]


def test_the_nodes_keep_their_order(tmp_path: Path) -> None:
    file = network(tmp_path)
    with edited(file) as (session, nodes):
        nodes.save(session, str(file))
    text = file.read_text(encoding="utf-8")
    assert text.index("  b:") < text.index("  a:")


@pytest.mark.parametrize("name", sorted(NOT_EDITED))
def test_other_examples_do_not_open(name: str) -> None:
    with pytest.raises(UsageError, match="its nodes have no EDS"):
        file_to_edit(str(EXAMPLES / name))


LINKED = """nodes:
  a:
    node_id: 1
    dcf: gen4
    heartbeat_producer: 700
    tpdo:
      1: {mapping: [6041:00, 606C:00]}
  b:
    node_id: 2
    dcf: gen4
links:
  - {from: a:tpdo2, to: b:rpdo2, heartbeat: false}
"""


def end(text: str) -> Endpoint:
    node_id, pdo = text.split(":")
    return Endpoint(int(node_id), Pdo.parse(pdo))


def rpdo1(file: Path) -> PartialPdoConfig | None:
    node = next(node for node in read_network_file(file).nodes if node.node_id == 2)
    return next((config for config in node.pdos if config.pdo == Pdo.parse("rpdo1")), None)


def test_a_link_is_written_in_the_files_way(tmp_path: Path) -> None:
    file = network(tmp_path, LINKED)
    with unedited(file) as (session, nodes):
        said, is_bad = nodes.link(end("1:tpdo1"), end("2:rpdo1"), {})
        assert said.startswith("2:rpdo1 receives 1:tpdo1 with 0x181; kept in links; n shows node 2"), said
        assert not is_bad
        assert nodes.offered_watch_ms(end("2:rpdo1")) is None, "the link sets it up"
        assert "check: 0 errors" in nodes.judge(1, {}).status
        shown = nodes.editor(2).pdos.now[Pdo.parse("rpdo1")]
        assert nodes.save(session, str(file)) == f"{file}: 2:rpdo1, link 1:tpdo1 to 2:rpdo1 written"
    assert read_network_file(file).links == (
        LinkConfig(end("1:tpdo2"), (end("2:rpdo2"),), False),
        LinkConfig(end("1:tpdo1"), (end("2:rpdo1"),)),
    )
    made = rpdo1(file)
    assert made is not None
    assert (made.cob_id, made.enabled) == (None, None), "the link gives them"
    assert [word.text for word in made.mapping or ()] == ["controlword", "0007:00/32"]
    with unedited(file) as (_session, nodes):
        assert nodes.editor(2).pdos.now[Pdo.parse("rpdo1")] == shown
        nodes.link(end("1:tpdo1"), end("2:rpdo1"), {})
        assert nodes.changed() == [], "the file has that link"


def test_an_rpdo_leaves_its_link_for_another(tmp_path: Path) -> None:
    file = network(tmp_path, LINKED)
    with unedited(file) as (session, nodes):
        said, is_bad = nodes.link(end("1:tpdo1"), end("2:rpdo2"), {})
        assert "kept in links, instead of that from 1:tpdo2" in said
        assert not is_bad
        nodes.save(session, str(file))
    assert read_network_file(file).links == (LinkConfig(end("1:tpdo1"), (end("2:rpdo2"),)),)


def test_a_link_is_gone_once_its_rpdo_is_as_before(tmp_path: Path) -> None:
    with unedited(network(tmp_path, LINKED)) as (_session, nodes):
        nodes.link(end("1:tpdo1"), end("2:rpdo1"), {})
        assert nodes.changed() == ["2:rpdo1", "link 1:tpdo1 to 2:rpdo1"]
        nodes.editor(2).pdos.undo()
        assert nodes.changed() == []


def test_a_link_alone_is_a_change(tmp_path: Path) -> None:
    received = "    rpdo:\n      1: {cob_id: 0x181, enabled: true, mapping: [6040:00, dummy/32]}\nlinks:"
    file = network(tmp_path, LINKED.replace("links:", received))
    before = rpdo1(file)
    with unedited(file) as (session, nodes):
        nodes.link(end("1:tpdo1"), end("2:rpdo1"), {})
        assert nodes.changed() == ["link 1:tpdo1 to 2:rpdo1"]
        assert nodes.save(session, str(file)) == f"{file}: link 1:tpdo1 to 2:rpdo1 written"
    assert len(read_network_file(file).links) == 2
    assert rpdo1(file) == before


@pytest.mark.parametrize(
    ("of_a", "of_b", "offered"),
    [
        ("heartbeat_producer: 700", "prune: false", 2100),
        ("heartbeat_producer: 0", "prune: false", None),
        ("prune: false", "heartbeat_producer: 700", None),
        ("heartbeat_producer: 700", "heartbeat_consumer: {a: 900}", None),
        ("heartbeat_producer: 65535", "prune: false", None),
    ],
)
def test_a_heartbeat_consumer_is_offered_for_a_heartbeat_that_nobody_watches(
    tmp_path: Path, of_a: str, of_b: str, offered: int | None
) -> None:
    text = f"nodes:\n  a: {{node_id: 1, dcf: gen4, {of_a}}}\n  b: {{node_id: 2, dcf: gen4, {of_b}}}\n"
    with unedited(network(tmp_path, text)) as (_session, nodes):
        nodes.link(end("1:tpdo1"), end("2:rpdo1"), {})
        assert nodes.offered_watch_ms(end("2:rpdo1")) == offered
        assert nodes.changed() == ["2:rpdo1"]
