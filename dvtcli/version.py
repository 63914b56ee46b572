"""The version of dvtcli."""

__version__ = "0.9.0"
#: What package indexes and pip call it; the import, the command and the folder are `dvtcli`.
DISTRIBUTION = "canopen-dvtcli"
