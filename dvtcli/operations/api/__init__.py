"""dvtcli for programs: `import dvtcli` hands on what is here. Prints nothing, and knows no words of a command line."""
