"""The strict simulated device: CiA 301's rules as a state machine, written independently of `dvtcli.domain.rules`."""
