"""The fixtures of dvtcli.testing: simulated nodes for each test."""

pytest_plugins = ["dvtcli.testing"]
