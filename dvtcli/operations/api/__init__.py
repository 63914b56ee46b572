"""The Python API: `import dvtcli` exports these names. Prints nothing."""
