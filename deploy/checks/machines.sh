#!/bin/bash
# Fly a fleet with keys on two machines that are network namespaces of this one, joined by a cable:
# on each a router and half of the UAVs, on the first the coordinator. In flight the cable is
# pulled, and put in again. Says what it saw; exit status 0: every task was done, and each side
# told that the other was gone and that it was back.
#
#     sudo deploy/checks/machines.sh [UAVS [CUT_S [LINK]]]          (make check-machines)
#
# By default 10 UAVs, 20 s without a cable and --link normal. Needs root, ip (iproute2) and the
# project's .venv. Logs and keys stay in build/check-machines.
#
# What this cannot show: what two machines can do that one cannot, as both share its processors,
# and clocks that differ.
set -eu

project=$(cd "$(dirname "$0")/../.." && pwd)
swarm=$project/.venv/bin/swarm
python=$project/.venv/bin/python
folder=$project/build/check-machines
uavs=${1:-10} cut_s=${2:-20} link=${3:-normal}
start_limit_s=300 flight_limit_s=900
a=peckorder-a-$$ b=peckorder-b-$$
a_address=10.77.0.1 b_address=10.77.0.2
pids=()

fail() { echo "machines.sh: $1" >&2; exit 1; }
[ "$(id -u)" = 0 ] || fail "only root can make network namespaces"
command -v ip >/dev/null || fail "ip (iproute2) is missing"
case $uavs in *[!0-9]* | 0 | 1) fail "UAVS must be a number, 2 or more" ;; esac

clean() {
    trap - EXIT INT TERM
    [ ${#pids[@]} = 0 ] || kill "${pids[@]}" 2>/dev/null || true
    wait || true
    for name in "$a" "$b"; do ip netns del "$name" 2>/dev/null || true; done
}
trap clean EXIT
trap 'exit 130' INT TERM

rm -rf "$folder"
mkdir -p "$folder/log"
scenario=$folder/survey.toml keys=$folder/keys
"$python" - "$uavs" >"$scenario" <<'PYTHON'
import sys
from sim.bench.fleets import survey_mission
from swarm.scenario.write import format_scenario
uavs = int(sys.argv[1])
print(format_scenario(survey_mission(uavs, 6 * uavs, seed=0)))
PYTHON
"$swarm" keys init "$scenario" --out "$keys" --routers 2 >/dev/null

echo "two machines, $a_address and $b_address, and a cable"
ip netns add "$a"
ip netns add "$b"
ip -n "$a" link add cable type veth peer name cable netns "$b"
ip -n "$a" address add "$a_address/24" dev cable
ip -n "$b" address add "$b_address/24" dev cable
for name in "$a" "$b"; do
    ip -n "$name" link set lo up
    ip -n "$name" link set cable up
done

# on MACHINE NAME WORD...: a process of the fleet there, its log under that name
on() {
    local machine=$1 name=$2
    shift 2
    SWARM_LOG_FORMAT=lines ip netns exec "$machine" "$swarm" "$@" \
        >"$folder/log/$name.out" 2>"$folder/log/$name.err" </dev/null &
    pids+=($!)
}
# until_there LIMIT_S WHAT COMMAND...: waits until the command succeeds
until_there() {
    local limit_s=$1 what=$2 begun_s=$SECONDS
    shift 2
    until "$@" >/dev/null 2>&1; do
        [ $((SECONDS - begun_s)) -lt "$limit_s" ] || fail "$what: not within $limit_s s"
        sleep 0.5
    done
}
listens() { ip netns exec "$1" "$python" -c \
    'import socket, sys; socket.create_connection(("127.0.0.1", int(sys.argv[1])), 1).close()' "$2"; }
told() { grep -q -- "$2" "$folder/log/$1.err"; }

on "$a" router-a router --keys "$keys/router" --listen tls/0.0.0.0:7447 --link "$link"
until_there 60 "the first router" listens "$a" 7447
on "$b" router-b router --keys "$keys/router-2" --listen tls/0.0.0.0:7447 \
    --connect "tls/$a_address:7447" --link "$link"
until_there 60 "the second router" listens "$b" 7447

half=$((uavs / 2))
begun_s=$SECONDS
# fly MACHINE SIDE OTHER_ROUTER FIRST LAST: autopilots and agents of these UAVs
fly() {
    local machine=$1 side=$2 other=$3 number uav words=()
    for number in $(seq "$4" "$5"); do words+=(--uav "$(printf 'uav%03d' "$number")"); done
    on "$machine" "autopilots-$side" autopilot "$scenario" "${words[@]}" --listen tcp:127.0.0.1:20001
    until_there 120 "autopilots of $side" listens "$machine" $((20000 + $5 - $4 + 1))
    for number in $(seq "$4" "$5"); do
        uav=$(printf 'uav%03d' "$number")
        on "$machine" "$uav" agent --mission survey --uav "$uav" --keys "$keys/$uav" \
            --connect tls/127.0.0.1:7447 --connect "$other" --link "$link" \
            --mavlink "tcp:127.0.0.1:$((20001 + number - $4))" --system-id "$number"
    done
}
on "$a" coordinator coordinator "$scenario" --keys "$keys/coordinator" --method greedy \
    --start-timeout-s "$start_limit_s" --link "$link" --connect tls/127.0.0.1:7447 \
    --connect "tls/$b_address:7447"
coordinator=${pids[-1]}
fly "$a" a "tls/$b_address:7447" 1 "$half"
fly "$b" b "tls/$a_address:7447" $((half + 1)) "$uavs"
until_there "$start_limit_s" "the start of the mission" told uav001 "mission runs"
echo "$half UAVs on one and $((uavs - half)) on the other machine in the air after" \
    "$((SECONDS - begun_s)) s"

sleep 10
ip -n "$a" link set cable down
echo "cable pulled"
sleep "$cut_s"
gone_b=$(grep -c -- "event=lost" "$folder/log/uav001.err" || true)
gone_a=$(grep -c -- "event=lost" "$folder/log/$(printf 'uav%03d' "$uavs").err" || true)
ip -n "$a" link set cable up
echo "cable in again after $cut_s s: meanwhile uav001 missed $gone_b, and uav$(printf '%03d' "$uavs")" \
    "$gone_a others (the coordinator is one)"

begun_s=$SECONDS
while kill -0 "$coordinator" 2>/dev/null; do
    [ $((SECONDS - begun_s)) -lt "$flight_limit_s" ] || fail "the mission: not over within $flight_limit_s s"
    sleep 1
done
status=0
wait "$coordinator" || status=$?
back=$(grep -c -- "event=back" "$folder/log/uav001.err" || true)
echo "uav001 saw $back come back; coordinator's exit status $status; its last word:"
tail -n 1 "$folder/log/coordinator.err"
if [ "$status" = 0 ] && [ "$gone_b" -gt 0 ] && [ "$gone_a" -gt 0 ] && [ "$back" -gt 0 ]; then
    echo "all is well"
else
    fail "not all is well; logs are in $folder/log"
fi
