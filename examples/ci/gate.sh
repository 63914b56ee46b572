#!/usr/bin/env bash
# What has to hold before network.yaml may go to a machine. No hardware: nodes are simulated, and strict.
# FORMAT is github, junit or nothing; with junit the reports are in the folder reports/. BUS is how dvtcli reaches a
# bench, if there is one, e.g. "-i socketcan -c can0".
set -euo pipefail
cd "$(dirname "$0")"

# report NAME COMMAND...: run dvtcli COMMAND in this FORMAT
report() {
    local file="reports/$1.xml"
    shift
    if [ "${FORMAT:-}" = junit ]; then
        mkdir -p reports
        dvtcli "$@" --format junit > "$file"
    else
        dvtcli "$@" ${FORMAT:+--format "$FORMAT"}
    fi
}

echo "== the file and the network that it makes"
report check check network.yaml --strict

echo "== what its frames need of a bus of 125 kbit/s, at worst"
dvtcli load network.yaml --at 125000

echo "== nodes as they come from their makers take it, keep it, and then nothing is left to do"
report rehearsal --sim gen4@1 --sim generic@5 --yes --quiet run rehearsal.dvt

if [ -n "${BUS:-}" ]; then
    echo "== the bench holds what the file says"
    # shellcheck disable=SC2086 - several words
    report bench $BUS plan network.yaml --exit-code
fi
