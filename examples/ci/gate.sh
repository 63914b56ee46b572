#!/usr/bin/env bash
# What has to hold before network.yaml may go to a machine. No hardware: nodes are simulated, and strict.
# FORMAT is github, junit or nothing; BUS is how dvtcli reaches a bench, if there is one, e.g. "-i socketcan -c can0".
set -euo pipefail
cd "$(dirname "$0")"
format=(${FORMAT:+--format "$FORMAT"})

echo "== the file and the network that it makes"
dvtcli check network.yaml --strict "${format[@]}"

echo "== what its frames need of a bus of 125 kbit/s, at worst"
dvtcli load network.yaml --at 125000

echo "== nodes as they come from their makers take it, keep it, and then nothing is left to do"
dvtcli --sim gen4@1 --sim generic@5 --yes --quiet run rehearsal.dvt "${format[@]}"

if [ -n "${BUS:-}" ]; then
    echo "== the bench holds what the file says"
    # shellcheck disable=SC2086 - several words
    dvtcli $BUS plan network.yaml --exit-code "${format[@]}"
fi
