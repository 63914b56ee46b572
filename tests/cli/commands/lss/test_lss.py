"""`lss`: wrong words, a dry run, and nobody to ask."""

from __future__ import annotations

import pytest

from dvtcli.domain.can_ids import LSS_REQUEST_ID
from dvtcli.domain.nmt import UNCONFIGURED
from tests.cli.commands.bench import Ran
from tests.cli.commands.lss.lss_bench import bench, sent
from tests.lss_nodes import address_of, unconfigured

pytestmark = pytest.mark.drawn(14, "lss")


def test_nothing_is_sent_in_a_dry_run() -> None:
    with bench(unconfigured(1, node_id=5)) as session:
        frames = sent(session.session.bus)
        for line in ("scan", "identify", "node-id 6", "store 5", f"select {address_of(unconfigured(1))}"):
            ran = session.run(f"lss {line} --dry-run")
            assert (ran.code, "Nothing was sent" in ran.stdout) == (0, True)
        assert frames == []


@pytest.mark.parametrize("line", ["node-id 5", "store 3"])
def test_nobody_to_ask_is_a_no(line: str) -> None:
    new, old = unconfigured(1), unconfigured(2, node_id=3)
    with bench(new, old, yes=False) as session:
        session.run(f"lss select {address_of(new)}")
        ran = session.run(f"lss {line}")
        ran.failed(6, "--yes")
        assert (new.lss.pending, old.lss.stored) == (UNCONFIGURED, 3)
        assert not [frame for frame in sent(session.session.bus) if frame.can_id == LSS_REQUEST_ID]


WRONG = [
    ("lss identify serial=1-2", "vendor, product missing"),
    ("lss identify vendor=1 product=2 serial=5-4", "the lower number first"),
    ("lss identify vendor=1-2 product=2", "vendor=1-2"),
    ("lss identify vendor=1 product=2 revision=1-x", "revision=1-x"),
    ("lss assign", "takes one network file"),
    ("lss scan --store", "belongs to lss assign"),
    ("lss bitrate 500k --prove", "lss bitrate with --store"),
    ("lss bitrate", "takes a bit rate"),
    ("lss bitrate 500kHz", "is not a bit rate"),
    ("lss bitrate 100k", "has no bit rate 100000"),
    ("lss select vendor=1", "product, revision, serial missing"),
    ("lss select vendor=1 vendor=2", "given twice"),
    ("lss select vendor=1 model=2", "write vendor="),
    ("lss select vendor=x product=1 revision=1 serial=1", "vendor=x"),
    ("lss select vendor=-1 product=1 revision=1 serial=1", "32 bits"),
    ("lss node-id", "needs the node-ID"),
    ("lss node-id 128", "1…127"),
    ("lss scan 5", "unexpected"),
    ("lss store 5 6", "unexpected"),
    ("lss identify --wait 20", "belongs to lss scan"),
    ("lss assign line.yaml --prove", "belongs to lss store"),
    ("lss node-id 5 --prove", "belongs to lss store"),
    ("lss select 128", "1…127"),
]


@pytest.mark.parametrize(("line", "said"), WRONG)
def test_wrong_words(line: str, said: str) -> None:
    with bench(unconfigured(1)) as session:
        ran: Ran = session.run(line)
        ran.failed(2, said)
