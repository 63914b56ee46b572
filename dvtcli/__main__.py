"""`python -m dvtcli` is `dvtcli`."""

from dvtcli.cli import entry

entry()
