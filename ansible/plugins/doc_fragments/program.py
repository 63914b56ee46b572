"""What every module of the collection takes: the bus, and which dvtcli is to run."""

from __future__ import annotations


class ModuleDocFragment:
    """Read by ansible-doc."""

    DOCUMENTATION = r"""
options:
  bus:
    description: The bus, with the names of python-can. Left out, the host's own dvtcli.toml or environment chooses.
    type: dict
    default: {}
    suboptions:
      interface: {description: Interface of python-can, type: str}
      channel: {description: Its channel, type: str}
      bitrate: {description: Bit rate in bit/s, type: int}
      kwargs: {description: Further keys of the interface, type: dict, default: {}}
      sim: {description: Simulated nodes instead of a bus, type: list, elements: str, default: []}
  timeout:
    description: SDO time-out in seconds.
    type: float
  executable:
    description:
      - The dvtcli to run.
      - Left out, the one on the host's PATH, or else that of the role P(dvtcli.canopen.bench#role) in /opt/dvtcli.
    type: str
"""
