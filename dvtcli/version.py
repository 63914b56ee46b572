"""Which dvtcli this is. The lowest brick of the house: everybody may say it."""

__version__ = "0.1.0"
#: What package indexes and pip call it; the import, the command and the folder are `dvtcli`.
DISTRIBUTION = "canopen-dvtcli"
