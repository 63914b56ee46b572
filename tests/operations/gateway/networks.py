"""Network files for one node of a family: what PDOs may be wished of it, and everything that its PDOs hold."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from dvtcli.domain.pdo import Pdo, PdoConfig
from tests.cli.commands.bench import Bench

FAMILIES = ("gen4", "generic", "espac", "tmcm")


def options() -> st.SearchStrategy[str]:
    """The keys of a network file for a node: a TPDO and an RPDO with any mapping of what a drive has."""
    mapped = st.sampled_from(["[6041:00/16]", "[606C:00/32]", "[6041:00/16, 606C:00/32]"])
    taken = st.sampled_from(["[6040:00/16]", "[60FF:00/32]", "[6040:00/16, 60FF:00/32]"])
    return st.builds(
        "heartbeat_producer: {}\n    tpdo: {{1: {{enabled: {}, cob_id: 0x{:X}, transmission: {}, mapping: {}}}}}\n"
        "    rpdo: {{1: {{enabled: {}, mapping: {}}}}}\n".format,
        st.integers(100, 900),
        st.sampled_from(["true", "false"]),
        st.sampled_from([0x184, 0x1A0, 0x284]),
        st.sampled_from([1, 3, 255]),
        mapped,
        st.sampled_from(["true", "false"]),
        taken,
    )


def network_file(folder: Path, config: str) -> Path:
    """The network file that wishes *config* of node 4."""
    path = folder / "wished.yaml"
    path.write_text(f"nodes:\n  one:\n    node_id: 4\n    {config}")
    return path


def everything(bench: Bench) -> tuple[dict[Pdo, PdoConfig], bytes]:
    """All PDOs of node 4 and its heartbeat time, read anew."""
    node = bench.session.node(4)
    node.read_anew()
    return dict(node.pdos()), node.upload(0x1017, 0)
