"""dvtcli as it would run elsewhere: Windows' and macOS's standard library and files, wherever the tests run."""
