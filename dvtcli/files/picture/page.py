"""A network as a page: one HTML file that asks for nothing else, the same for the same network. Reads nothing."""

from __future__ import annotations

from base64 import b64encode
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from typing import Any

from dvtcli.domain.network.picture import NetworkPicture
from dvtcli.domain.safe_text import safe
from dvtcli.domain.several import plural
from dvtcli.files.picture import page_tables as tables
from dvtcli.files.picture.cob_id_map import cob_id_map
from dvtcli.files.picture.frame_cards import frame_cards
from dvtcli.files.picture.picture_words import kbit, percent
from dvtcli.files.picture.svg import markup, style
from dvtcli.files.picture.wiring import wiring

#: how wide drawings are: on a desk, and on a phone
_WIDE, _NARROW = 960, 352


@dataclass(frozen=True, slots=True)
class Tile:
    """A number of the summary, what it counts, and how good that is (`good`, `bad`, or nothing)."""

    value: str
    label: str
    style: str = ""
    target: str = ""


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the contents: a section, and how many things are in it (empty where that says nothing)."""

    target: str
    title: str
    count: str = ""


def page(picture: NetworkPicture) -> bytes:
    """The page, UTF-8."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    def plain(value: Any) -> Any:
        """Texts without what could steer a reader; markup of ours as it is."""
        return value if isinstance(value, Markup) else safe(value) if isinstance(value, str) else value

    environment = Environment(
        loader=FunctionLoader(lambda name: (files(__package__) / name).read_text("utf-8")), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=plain,
    )  # fmt: skip
    sheet, script = style("palette.css", "drawing.css", "page.css"), style("page.js")
    drawings = {
        f"{name}_{size}": Markup(markup(draw(picture, width, f"{name}-{size}")))  # noqa: S704 - its texts are escaped
        for name, draw in (("wiring", wiring), ("map", cob_id_map))
        for size, width in (("wide", _WIDE), ("narrow", _NARROW))
    }
    text = environment.get_template("page.html").render(
        picture=picture, tiles=tuple(_tiles(picture)), contents=tuple(_contents(picture)),
        cards=tuple(frame_cards(picture)), rate=_rate(picture),
        findings=tables.findings_table(picture), differences=tables.differences_table(picture),
        nodes=tables.nodes_table(picture), pdos=tables.pdos_table(picture), frames=tables.frames_table(picture),
        fitting=", ".join(kbit(rate) for rate in picture.load.fitting), percent=percent,
        sheet=Markup(sheet), script=Markup(script),  # noqa: S704 - ours, without any text of a network
        sheet_hash=_hash(sheet), script_hash=_hash(script), **drawings,
    )  # fmt: skip
    return (text.rstrip() + "\n").encode()


def _hash(text: str) -> str:
    """How a page's policy names what it may run: nothing else is run, whatever a text gets in."""
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"


def _rate(picture: NetworkPicture) -> str:
    return kbit(picture.load.bit_rate) + (" (assumed)" if picture.load.is_assumed else "")


def _contents(picture: NetworkPicture) -> Iterator[Entry]:
    """The sections in their order: on a phone the page is long."""
    yield Entry("wiring", "Wiring")
    yield Entry("findings", "Findings", str(len(picture.findings)))
    if picture.compared:
        count = "" if picture.differences is None else str(len(picture.differences))
        yield Entry("differences", "Differences", count)
    yield Entry("nodes", "Nodes", str(len(picture.nodes)))
    yield Entry("frames", "COB-IDs, load, times", str(len(picture.frames)))
    yield Entry("pdos", "PDOs", str(sum(1 for _ in picture.pdos)))
    yield Entry("layouts", "Layouts", str(sum(1 for _ in frame_cards(picture))))


def _tiles(picture: NetworkPicture) -> Iterator[Tile]:
    """What somebody wants to know first."""
    load, count = picture.load, Counter(finding.severity for finding in picture.findings)
    yield Tile(str(len(picture.nodes)), "node" if len(picture.nodes) == 1 else "nodes", target="nodes")
    on = sum(pdo.config.enabled for _, pdo in picture.pdos)
    yield Tile(str(on), "PDO is on" if on == 1 else "PDOs are on", target="pdos")
    yield Tile(str(len(picture.links)), "link" if len(picture.links) == 1 else "links", target="wiring")
    is_bad = load.total is None or load.total > 1
    yield Tile(percent(load.total), f"bus load at worst, {_rate(picture)}", "bad" if is_bad else "", "frames")
    if load.measured is not None:
        yield Tile(percent(load.measured), f"bus load heard in {load.seconds:.1f} s", target="frames")
    in_time = "good" if load.fits else "bad"
    yield Tile("all" if load.fits else "not all", "frames are in time", in_time, "frames")
    said = [plural(count[severity], severity) for severity in ("error", "warning", "note") if count[severity]]
    bad = "bad" if count["error"] else "warn" if count["warning"] else "good"
    label = f"findings: {', '.join(said)}" if said else "findings"
    yield Tile(str(len(picture.findings)) if said else "none", label, bad, "findings")
    if picture.compared:
        differing = "not known" if picture.differences is None else str(len(picture.differences))
        style_of = "good" if picture.differences == () else "bad" if picture.differences is None else "warn"
        noun = "difference" if differing == "1" else "differences"
        yield Tile(differing, f"{noun} to {picture.compared}", style_of, "differences")
