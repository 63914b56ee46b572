"""A node of a network file as what a manager downloads to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.network.concise_dcf import SUFFIX
from dvtcli.operations.conversions.conversion_format import ConversionFormat, Converted

if TYPE_CHECKING:
    from dvtcli.operations.results.files import Facts
    from dvtcli.operations.session.session import Session


class ConciseDcfFormat(ConversionFormat):
    """A concise DCF (0x1F22) of one node."""

    suffixes = (SUFFIX,)
    instead_of_a_node = None

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write it, as `convert_network` does."""
        from dvtcli.operations.network.concise_network import convert_network

        return convert_network(session, wanted.source, wanted.target, wanted.node)
