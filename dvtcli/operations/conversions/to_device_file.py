"""A file that describes a device, as another one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.files.device_file import DEVICE_SUFFIXES
from dvtcli.operations.conversions.conversion_format import ConversionFormat, Converted

if TYPE_CHECKING:
    from dvtcli.operations.results.files import Facts
    from dvtcli.operations.session.session import Session


class DeviceFileFormat(ConversionFormat):
    """EDS and XDD, DCF and XDC."""

    suffixes = DEVICE_SUFFIXES

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write it, as `convert_device_file` does; UsageError for another suffix."""
        from dvtcli.operations.exchange.convert_device import convert_device_file

        return convert_device_file(session, wanted.source, wanted.target)
