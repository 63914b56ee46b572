"""A network as a page, a drawing and a graph: all of it there, nothing of it markup, the same bytes each time."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from fractions import Fraction
from html.parser import HTMLParser
from pathlib import Path
from types import FrameType
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dvtcli
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.picture import (
    NetworkPicture,
    PictureDifference,
    PictureField,
    PictureFinding,
    PictureFrame,
    PictureLink,
    PictureLoad,
    PictureNode,
    PicturePdo,
)
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.scaling import Scaling
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.files.picture.page import frame_cards, page
from dvtcli.files.picture.wiring import alone, clipped_name, graphviz, wiring
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.process import ROOT

LINE = ROOT / "examples" / "line.yaml"
VOID = {"meta", "link", "br"}


class Read(HTMLParser):
    """A page as a browser sees it: its tags are closed in their order, its texts and attributes are gathered."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.texts: list[str] = []
        self.ids: list[str] = []
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        self.ids += [value or "" for name, value in attrs if name == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


def drawn(tmp_path: Path, file: Path, name: str = "x.html", **options: object) -> str:
    dvtcli.report(tmp_path / name, file, yes=True, **options)  # type: ignore[arg-type]
    return (tmp_path / name).read_text("utf-8")


@heavy
def test_the_page_of_a_file_has_all_of_it_and_is_the_same_each_time(tmp_path: Path) -> None:
    first, again = (drawn(tmp_path, LINE, name, bit_rate=500_000) for name in ("a.html", "b.html"))
    assert first == again
    read = Read(first)
    for said in ("drive", "io", "Gen4", "0x181", "0x185", "Velocity actual value", "i32", "every 500 ms", "1:TPDO1",
                 "5:RPDO1", "inhibit 10 ms", "0x701", "none findings"):  # fmt: skip
        assert said in read.text, said
    assert len(read.ids) == len(set(read.ids))
    targets = {value[1:] for name, value in read.attributes if name == "href" and value.startswith("#")}
    assert targets - {"differences"} <= set(read.ids)


def test_the_page_asks_for_nothing_and_runs_only_its_own_script(tmp_path: Path) -> None:
    text = drawn(tmp_path, LINE)
    read = Read(text)
    assert re.findall(r"https?://[^\s\"'<>]*", text.replace("http://www.w3.org/2000/svg", "")) == []
    assert [value for name, value in read.attributes if name in ("src", "href") and not value.startswith("#")] == [
        "data:,"
    ]
    assert {name for name, _ in read.attributes if name.startswith("on") or name == "style"} == set()
    assert (read.tags.count("script"), read.tags.count("style")) == (1, 1)
    policy = next(value for name, value in read.attributes if name == "content" and "default-src" in value)
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy


@heavy
def test_a_bus_is_drawn_as_it_is_and_compared_with_a_file(tmp_path: Path) -> None:
    with dvtcli.simulate("gen4@1", "generic@5") as bus:
        bus.apply(LINE, yes=True)
        assert bus.report(tmp_path / "x.html", LINE) == ()
        same = Read((tmp_path / "x.html").read_text("utf-8"))
        assert "None: every node has the values of the file." in same.text
        bus.node(5).set("tpdo1", timer_ms=70, yes=True)
        with pytest.raises(SafetyRefusal):
            bus.report(tmp_path / "x.html", LINE)
        bus.report(tmp_path / "x.html", LINE, yes=True, title="Halle 3")
        differing = Read((tmp_path / "x.html").read_text("utf-8"))
    assert "1 difference to line.yaml" in differing.text
    assert "event_timer 70 ms 50 ms" in differing.text
    assert "Halle 3" in differing.text


def test_what_cannot_be_compared_is_said_and_drawn_all_the_same(tmp_path: Path) -> None:
    other = tmp_path / "other.yaml"
    other.write_text("a: {node_id: 1, identity: {vendor: 0x1, product: 0x2}, tpdo: {1: {event_timer: 70}}}\n")
    with dvtcli.simulate("generic@1") as bus:
        (note,) = bus.report(tmp_path / "x.html", other)
    assert note.startswith("not compared with other.yaml: ")
    read = Read((tmp_path / "x.html").read_text("utf-8"))
    assert "They could not be found out: see Findings ." in read.text
    assert ", not compared with other.yaml, " in read.text


SWAPPED = "a: {node_id: 1, dcf: gen4, identity: {vendor: 0x1E}}\nb: {node_id: 5, dcf: tmcm}\n"


@heavy
def test_swapped_devices_are_findings_and_the_exit_code_is_that_of_diff(tmp_path: Path) -> None:
    (tmp_path / "line.yaml").write_text(SWAPPED)
    with Bench(("gen4@5", "tmcm@1"), {"yes": True}) as bench:
        ran = bench.run(f"report {tmp_path / 'x.html'} {tmp_path / 'line.yaml'} --json")
        assert (ran.code, bench.run(f"diff {tmp_path / 'line.yaml'}").code) == (6, 6)
    text = (tmp_path / "x.html").read_text("utf-8")
    findings = text[text.index('<section id="findings"') : text.index('<section id="differences"')]
    assert findings.count("eds-identity") == 4
    assert "its vendor is 0x00000286, the file says 0x0000001E" in findings
    assert ran.document["findings"] >= 5
    assert "node 5 is vendor 0x0000001E" in ran.document["notes"][0]


def test_a_node_that_is_not_there_is_a_finding(tmp_path: Path) -> None:
    (tmp_path / "line.yaml").write_text("a: {node_id: 1, dcf: gen4}\nb: {node_id: 5, dcf: tmcm}\n")
    with Bench(("gen4@1",), {"yes": True}) as bench:
        ran = bench.run(f"report {tmp_path / 'x.html'} {tmp_path / 'line.yaml'}")
        assert (ran.code, bench.run(f"diff {tmp_path / 'line.yaml'}").code) == (5, 5)
    read = Read((tmp_path / "x.html").read_text("utf-8"))
    assert "error: not compared with line.yaml: node 5 " in ran.stdout
    assert "node 5" in read.text[read.text.index("Findings") :]


@heavy
def test_a_file_is_read_and_simulated_once(tmp_path: Path) -> None:
    """A page of 100 nodes takes as long as that."""
    from dvtcli.files.network.read_network import read_network_file
    from dvtcli.operations.network.described_network import described_network

    seen: list[str] = []
    looked_for = {one.__code__: one.__name__ for one in (read_network_file, described_network)}

    def look(frame: FrameType, event: str, _argument: object) -> None:
        if event == "call" and frame.f_code in looked_for:
            seen.append(looked_for[frame.f_code])

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        dvtcli.report(tmp_path / "x.html", LINE)
    finally:
        sys.setprofile(before)
    assert seen == ["read_network_file", "described_network"]


@heavy
def test_the_contents_lead_to_every_section_and_each_of_them_back(tmp_path: Path) -> None:
    with dvtcli.simulate("gen4@1", "generic@5") as bus:
        bus.report(tmp_path / "x.html", LINE, yes=True)
    for text in ((tmp_path / "x.html").read_text("utf-8"), drawn(tmp_path, LINE, "y.html")):
        contents = text[text.index("<nav ") : text.index("</nav>")]
        sections = re.findall(r'<section id="([a-z]+)"', text)
        assert re.findall(r'href="#([a-z]+)"', contents) == sections
        assert text.count('<a class="up" href="#contents">') == len(sections)
        assert "nav { display: none" in text[text.index("@media print") :]


def test_the_map_has_the_colours_of_its_legend(tmp_path: Path) -> None:
    """Red is what may be late, or has no limit: also where there is no deadline to be late for."""
    with dvtcli.simulate("gen4@1", "generic@5") as bus:
        bus.report(tmp_path / "x.html", yes=True)
    text = (tmp_path / "x.html").read_text("utf-8")
    kinds = {cob_id: kind for kind, cob_id in re.findall(r'class="place ([a-z]+)"><title>(0x[0-9A-F]{3})', text)}
    late = {cob_id for cob_id, kind in kinds.items() if kind == "late"}
    rows = re.findall(r'<tr role="row">.*?</tr>', text[text.index('id="frames"') : text.index('id="pdos"')], re.DOTALL)
    told = {re.findall("0x[0-9A-F]{3}", row)[0] for row in rows if "no limit" in row or " - late" in row}
    assert late == told
    assert {"0x181", "0x185", "0x285"} <= late
    assert "0x181 TPDO1 of node 1, no limit" in text


@pytest.mark.parametrize("name", ["x.html", "x.svg", "x.dot"])
def test_nothing_is_written_where_it_cannot_be_drawn(tmp_path: Path, name: str) -> None:
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("a: {node_id: 200}\n")
    with Bench(()) as bench:
        assert bench.run(f"report {tmp_path / name} {wrong}").code == 4
        assert bench.run(f"report {tmp_path / 'x.png'} {LINE}").code == 2
    assert not (tmp_path / name).exists()
    with pytest.raises(UsageError):
        dvtcli.report(tmp_path / "x.pdf", LINE)


@heavy
def test_what_the_file_says_of_values_is_in_the_page(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    said = "    physical: {606C: {unit: mm/s, factor: 0.25}}\n"
    file.write_text(
        "nodes:\n  a:\n    node_id: 1\n    profile: generic\n" + said + "    tpdo: {1: {mapping: [606C:00/32]}}\n"
    )
    for sim in ((), ("generic@1",)):
        with Bench(sim, {"yes": True}) as bench:
            ran = bench.run(f"apply {file}") if sim else None
            assert ran is None or ran.code == 0
            assert bench.run(f"report {tmp_path / 'net.html'} {file}").code == 0
        assert "0.25 mm/s" in (tmp_path / "net.html").read_text("utf-8")


@given(st.text("abc_1", max_size=90), st.integers(40, 400))
def test_a_long_name_is_cut_in_its_middle(name: str, room: int) -> None:
    shown = clipped_name(name, room, 14)
    assert len(shown) <= max(1, room / 9)
    head, cut, tail = shown.partition("…")
    assert (name == shown) if not cut else (name.startswith(head) and name.endswith(tail) and len(name) > len(shown))


def test_the_wiring_alone(tmp_path: Path) -> None:
    root = ElementTree.fromstring(drawn(tmp_path, LINE, "x.svg"))  # noqa: S314 - ours
    paths = [one for one in root.iter("{http://www.w3.org/2000/svg}path") if "link" in one.get("class", "")]
    assert [one[0].text for one in paths] == ["5:TPDO1 → 1:RPDO1, 0x185", "1:TPDO1 → 5:RPDO1, 0x181"]
    graph = drawn(tmp_path, LINE, "x.dot")
    assert 'n1:tpdo1:e -> n5:rpdo1:w [label="0x181"];' in graph
    assert graph.startswith('digraph "line" {')


HOSTILE = "</script><script>alert(1)</script>\"'&<b>{{ 7*7 }}]]>\x00\x1b[31m\u202e\ud800|{}<>\\ \n--"
texts = st.one_of(
    st.just(HOSTILE), st.text(max_size=12), st.sampled_from(["", "</style>", "<!--", "{% raw %}", "é—😀"])
)


@st.composite
def pictures(draw: st.DrawFn) -> NetworkPicture:
    """Any network, with any texts in it."""
    ids = draw(st.lists(st.integers(1, 127), min_size=1, max_size=4, unique=True))
    nodes = [draw(any_node(node_id)) for node_id in sorted(ids)]
    sends = [pdo for node in nodes for pdo in node.enabled(is_tpdo=True)]
    hears = [pdo for node in nodes for pdo in node.enabled(is_tpdo=False)]
    links = tuple(
        PictureLink(producer.end, consumer.end, producer.identifier, draw(st.booleans()))
        for producer in sends for consumer in hears if draw(st.booleans())
    )  # fmt: skip
    share = draw(st.one_of(st.none(), st.fractions(0, 2)))
    frames = tuple(PictureFrame(pdo.identifier, draw(texts), pdo.end.node_id, 8, draw(texts), Fraction(5), share)
                   for pdo in sends)  # fmt: skip
    findings = (PictureFinding(draw(st.sampled_from(["error", "warning", "note"])), "rule", draw(texts), ids[0], 3),)
    differing = draw(st.sampled_from([(), None, (PictureDifference(ids[0], draw(texts), "value", "1", draw(texts)),)]))
    load = PictureLoad(500_000, Fraction(1, 10), share, draw(st.booleans()), assumed=(draw(texts),))
    return NetworkPicture(draw(texts), draw(texts), tuple(nodes), links, frames, load, findings, draw(texts), differing,
                          (draw(texts),))  # fmt: skip


@st.composite
def any_node(draw: st.DrawFn, node_id: int) -> PictureNode:
    pdos = draw(st.lists(st.sampled_from(["tpdo1", "tpdo2", "rpdo1", "rpdo512"]), unique=True))
    found = tuple(draw(any_pdo(Endpoint(node_id, Pdo.parse(pdo)))) for pdo in sorted(pdos))
    return PictureNode(node_id, draw(texts), draw(texts), (("heartbeat", draw(texts)),), found, draw(st.booleans()))


@st.composite
def any_pdo(draw: st.DrawFn, end: Endpoint) -> PicturePdo:
    bits, entries, fields = 0, [], []
    for size in draw(st.lists(st.sampled_from([1, 3, 8, 16, 32]), max_size=5)):
        if bits + size > 64:
            break
        entries.append(PdoMappingEntry(0x2000 + bits, 1, size))
        meaning = Scaling(draw(texts), values={0: draw(texts)}, bits={0: draw(texts)})
        fields.append(PictureField(bits, size, f"{0x2000 + bits:04X}:01", draw(texts), draw(texts), meaning))
        bits += size
    extended = draw(st.booleans())
    cob_id = CobId(draw(st.integers(1, 0x1FFFFFFF if extended else 0x7FF)), draw(st.booleans()), True, extended)
    return PicturePdo(end, PdoConfig(PdoCommunicationParameter(cob_id, 255), tuple(entries)), tuple(fields))


@pytest.mark.long
@settings(max_examples=max(2, settings().max_examples // 4))  # each draws a page, twice
@given(picture=pictures())
def test_every_text_stays_text_and_every_pdo_is_there(picture: NetworkPicture) -> None:
    data = page(picture)
    assert data == page(picture)
    read = Read(data.decode())
    assert (read.tags.count("script"), read.tags.count("style")) == (1, 1)
    assert {name for name, _ in read.attributes if name.startswith("on")} == set()
    assert not set("\x00\x1b\u202e") & set(data.decode())
    for _, pdo in picture.pdos:
        assert not pdo.config.enabled or f"{pdo.end.pdo}-{pdo.end.node_id}" in read.ids
    ElementTree.fromstring(alone(wiring(picture)))  # noqa: S314 - ours
    graph = graphviz(picture).decode()
    assert len(graph.splitlines()) == 5 + len(picture.nodes) + len(picture.links)


@given(picture=pictures())
def test_the_bits_of_a_frame_are_all_drawn_once(picture: NetworkPicture) -> None:
    pdos = {(pdo.end.pdo.label, node.node_id): pdo for node, pdo in picture.pdos}
    for card in frame_cards(picture):
        pdo = pdos[card.title, int(card.anchor.rpartition("-")[2])]
        assert [sum(cell.bits for cell in cells) for _, cells in card.bytes] == [8] * ((pdo.config.bits + 7) // 8)
        for number, entry in enumerate(pdo.config.mapping, 1):
            assert sum(cell.bits for _, cells in card.bytes for cell in cells if cell.number == number) == entry.bits


def test_nodes_of_a_graph_stand_in_their_order_from_the_top() -> None:
    """Graphviz stacks what is not linked from below, so these are written the other way round, and first."""
    nodes = tuple(PictureNode(number, f"n{number}") for number in (1, 2, 5, 9))
    link = PictureLink(Endpoint(1, Pdo.parse("tpdo1")), Endpoint(5, Pdo.parse("rpdo1")), (0x181, False))
    load = PictureLoad(500_000, Fraction(0), Fraction(0), fits=True)
    text = graphviz(NetworkPicture("x", "x.yaml", nodes, (link,), (), load)).decode()
    assert re.findall(r"^  n(\d+) \[", text, re.MULTILINE) == ["9", "2", "1", "5"]
