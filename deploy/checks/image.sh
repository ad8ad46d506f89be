#!/bin/bash
# Build the images of this tree, run them as a user would, and take them down again; then say line
# by line what held, what did not, and what was not tried.
#
#     deploy/checks/image.sh [PART...]          (make check-image)
#
# PARTS, by default all: `demo`, the image to try; `workshop`, that of the devcontainer; `compose`,
# the fleet of compose.yaml; `machines`, two machines of compose.machine.yaml.
# The engine is the first of docker and podman that answers, or ENGINE; COMPOSE is how to compose,
# by default `docker compose` or `podman-compose`. Needs the project's .venv, the base image or a
# registry that has it, Debian's packages and the package index.
# The log, and the machines' keys, are in build/check-image, or in FOLDER.
# Exit status 0: nothing that was tried has failed. Without an engine nothing is tried.
#
# Containers, networks and volumes are named peckorder-check…, and gone at the end; the images
# stay, under that name.
# What this cannot show: processors other than this machine's, the editor that opens a devcontainer,
# and what two machines can do that one cannot.
set -eu

project=$(cd "$(dirname "$0")/../.." && pwd)
python=$project/.venv/bin/python
folder=${FOLDER:-$project/build/check-image}
recipe=$project/deploy/Containerfile
name=peckorder-check
parts=${*:-demo workshop compose machines}
token=looks-on-for-the-check
healthy_limit_s=180 flight_limit_s=900 stop_limit_s=30
failed=0

ok() { echo "ok         $*"; }
fails() { echo "FAILS      $*"; failed=$((failed + 1)); }
not_tried() { echo "not tried  $*"; }
# try WHAT COMMAND...: says how the command ended; what it prints goes into the log
try() {
    local what=$1 begun_s=$SECONDS
    shift
    if "$@" >>"$folder/log" 2>&1; then
        ok "$what ($((SECONDS - begun_s)) s)"
    else
        fails "$what: $folder/log"
        return 1
    fi
}
# within LIMIT_S COMMAND...: waits until the command succeeds
within() {
    local limit_s=$1 begun_s=$SECONDS
    shift
    until "$@"; do
        [ $((SECONDS - begun_s)) -lt "$limit_s" ] || return 1
        sleep 0.5
    done
}
answers() { command -v "$1" >/dev/null && "$1" info >/dev/null 2>&1; }
# waits_for_others COMPOSER: podman-compose 1.0 does not, and starts agents before there are keys
waits_for_others() { "$1" --version 2>/dev/null | grep -Eq 'compose version ([2-9]|1\.[1-9])'; }
at_hand() { "$engine" image inspect "$1" >/dev/null 2>&1 || "$engine" pull "$1"; }
inspect() { "$engine" inspect --format "$1" "$2"; }
free_port() { "$python" -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])'; }
# container PROJECT SERVICE: that of a composed fleet
container() {
    "$engine" ps --all --quiet --filter "label=com.docker.compose.project=$1" \
        --filter "label=com.docker.compose.service=$2"
}

# -- parts ------------------------------------------------------------------------------

build() {
    local words=(--file "$recipe" --target "$1" --tag "$name-$1")
    # Images of the OCI's own form have no health checks.
    [ "$engine" != podman ] || words+=(--format docker)
    "$engine" build "${words[@]}" "$project"
}
megabytes() { echo $(($(inspect '{{.Size}}' "$1") / 1000000)); }
is_healthy() {
    # Podman's timers are systemd's, which need not be there.
    if [ "$engine" = podman ]; then
        podman healthcheck run "$1"
    else
        [ "$(inspect '{{.State.Health.Status}}' "$1")" = healthy ]
    fi
}
runs_as_nobody() { [ "$("$engine" exec "$1" id -u)" = 10001 ]; }
# tells PORT TOKEN PATTERN: the dashboard's page for Prometheus has a line like that
tells() {
    "$python" - "$@" <<'PYTHON'
import re, sys, urllib.request
port, token, pattern = sys.argv[1:]
asked = urllib.request.Request(f"http://127.0.0.1:{port}/metrics")
asked.add_header("Authorization", f"Bearer {token}")
try:
    told = urllib.request.urlopen(asked, timeout=5).read().decode()
except OSError as error:
    sys.exit(f"{error}")
sys.exit(re.search(pattern, told, re.MULTILINE) is None)
PYTHON
}
turned_away() { ! tells "$1" wrong-token-of-the-check '' && tells "$1" "$token" ''; }
stops() {
    local begun_s=$SECONDS
    "$engine" stop -t "$stop_limit_s" "$1"
    echo "stopped after $((SECONDS - begun_s)) s with $(inspect '{{.State.ExitCode}}' "$1")"
    [ "$(inspect '{{.State.ExitCode}}' "$1")" = 0 ]
}
demo() {
    local it=$name-demo port
    try "demo: it is built" build demo || return 0
    ok "demo: $(megabytes "$it") MB, of which the base has $(megabytes "$base")"
    try "demo: it starts" "$engine" run --detach --name "$it" --publish 127.0.0.1::8080 \
        --env "SWARM_DASHBOARD_TOKEN=$token" "$it" || return 0
    port=$("$engine" port "$it" 8080/tcp | head -n 1)
    port=${port##*:}
    try "demo: its health check holds" within "$healthy_limit_s" is_healthy "$it" || true
    try "demo: it runs as user 10001" runs_as_nobody "$it" || true
    try "demo: the dashboard answers at a published port, who has the token" turned_away "$port" ||
        true
    try "demo: tasks get done" within "$flight_limit_s" \
        tells "$port" "$token" '^peckorder_tasks\{.*state="done".*\} [1-9]' || true
    try "demo: it stops within $stop_limit_s s of being told" stops "$it" || true
    "$engine" logs "$it" >"$folder/demo.log" 2>&1
    try "demo: another mission is flown to its end, without rights and with nothing to write to" \
        "$engine" run --rm --name "$name-flight" --read-only --tmpfs /tmp \
        --cap-drop ALL --security-opt no-new-privileges "$it" run meadow --speedup 4 || true
}

in_the_workshop() {
    # The tree as an editor would mount it, in the hands of the image's user.
    git -C "$project" ls-files -z | tar --create --directory "$project" --null --files-from - |
        "$engine" run --interactive --rm --name "$name-workshop" "$name-workshop" bash -euc '
            mkdir ~/peckorder && cd ~/peckorder && tar --extract --file -
            sh -c "$(python3 -c "import json
print(json.load(open(\".devcontainer/devcontainer.json\"))[\"postCreateCommand\"])")"
            .venv/bin/python -m pytest -q tests/unit/swarm/kernels/test_problem.py
            make demo
            chromium --version'
}
workshop() {
    try "workshop: it is built" build workshop || return 0
    ok "workshop: $(megabytes "$name-workshop") MB"
    try "workshop: it sets itself up, tests and flies as user 1000" in_the_workshop || true
}

# flown_by PROJECT: its coordinator has ended, and said that every task has
flown_by() {
    [ "$(inspect '{{.State.Status}}' "$(container "$1" coordinator)")" = exited ]
}
flies() {
    within "$flight_limit_s" flown_by "$1" || return 1
    "$engine" logs "$(container "$1" coordinator)" 2>&1 | tail -n 3
    [ "$(inspect '{{.State.ExitCode}}' "$(container "$1" coordinator)")" = 0 ]
}
# composed PROJECT FILE WORD...: the composer's word about a fleet
composed() {
    local fleet=$1 file=$project/deploy/$2
    shift 2
    $compose --project-name "$fleet" --file "$file" "$@"
}
compose() {
    local port
    port=$(free_port)
    export PECKORDER_DASHBOARD_PORT=$port
    try "compose: the fleet comes up" composed "$name-fleet" compose.yaml up --detach || return 0
    try "compose: its dashboard answers at a published port" within "$healthy_limit_s" \
        tells "$port" simulated-fleet-only '^peckorder_uav_present' || true
    try "compose: the mission is flown" flies "$name-fleet" || true
    try "compose: it is taken down" composed "$name-fleet" compose.yaml down --volumes || true
}

# as_owner WORD...: on the folder of the machines, which is user 10001's
as_owner() {
    "$engine" run --rm --user 0:0 --volume "$folder/machines:/machines" --entrypoint sh \
        "$name-fleet" -euc "$*"
}
make_machines() {
    as_owner 'rm -rf /machines/* &&
        swarm keys init meadow --routers 2 --out /machines/authority &&
        mkdir /machines/a /machines/b && cd /machines/authority &&
        cp -R router uav1 uav2 coordinator dashboard /machines/a &&
        cp -R router-2 uav3 /machines/b && chown -R 10001:10001 /machines/a /machines/b'
    cp "$project/sim/scenarios/meadow.toml" "$folder/meadow.toml"
    chmod a+r "$folder/meadow.toml"
}
machines() {
    local port_a port_b
    port_a=$(free_port) port_b=$(free_port)
    mkdir -p "$folder/machines"
    try "machines: keys are made" make_machines || return 0
    export PECKORDER_SCENARIO=$folder/meadow.toml PECKORDER_MISSION=meadow
    PECKORDER_DASHBOARD_PORT=$(free_port)
    export PECKORDER_DASHBOARD_PORT
    on_a() {
        PECKORDER_KEYS=$folder/machines/a PECKORDER_UAVS="uav1 uav2" PECKORDER_ROUTER_PORT=$port_a \
            composed "$name-a" compose.machine.yaml "$@"
    }
    on_b() {
        PECKORDER_KEYS=$folder/machines/b PECKORDER_UAVS=uav3 PECKORDER_FIRST_ID=3 \
            PECKORDER_ROUTER=router-2 PECKORDER_ROUTER_PORT=$port_b \
            PECKORDER_OTHERS="tls/$address:$port_a" composed "$name-b" compose.machine.yaml "$@"
    }
    try "machines: the first comes up, with two UAVs" on_a up --detach || return 0
    try "machines: the second comes up, with one, its router linked to the first's" \
        on_b up --detach || return 0
    try "machines: coordinator and dashboard come up on the first" \
        on_a --profile lead up --detach || return 0
    try "machines: the dashboard there sees all UAVs" within "$healthy_limit_s" \
        tells "$PECKORDER_DASHBOARD_PORT" simulated-fleet-only '^peckorder_uav_present\{.*"uav3".*\} 1' ||
        true
    try "machines: the mission is flown" flies "$name-a" || true
    try "machines: the first is taken down" on_a --profile lead down --volumes || true
    try "machines: the second is taken down" on_b down --volumes || true
}

# -- from the engine to the last word -------------------------------------------------------

clean() {
    local it fleet ids kind
    for it in demo flight workshop; do
        "$engine" rm --force "$name-$it" >/dev/null 2>&1 || true
    done
    for fleet in "$name-fleet" "$name-a" "$name-b"; do
        ids=$("$engine" ps --all --quiet --filter "label=com.docker.compose.project=$fleet")
        [ -z "$ids" ] || "$engine" rm --force $ids >/dev/null 2>&1 || true
        for kind in network volume; do
            ids=$("$engine" $kind ls --quiet --filter "label=com.docker.compose.project=$fleet")
            [ -z "$ids" ] || "$engine" $kind rm $ids >/dev/null 2>&1 || true
        done
    done
    [ ! -d "$folder/machines" ] || as_owner 'rm -rf /machines/*' >/dev/null 2>&1 || true
}

nothing_is_tried() {
    not_tried "anything of: $parts"
    echo "           $1."
    echo "           Without it the files are read by \`make test\` (tests/process/test_deploy.py): every command"
    echo "           in them is tried on the command line's own parser."
    exit 0
}

choose_engine() {
    local it
    engine=${ENGINE:-}
    for it in docker podman; do
        [ -n "$engine" ] || ! answers "$it" || engine=$it
    done
    [ -n "$engine" ] && answers "$engine" ||
        nothing_is_tried "No engine answers: neither Docker nor Podman"
    base=$(sed -n 's/^ARG BASE=//p' "$recipe")
    at_hand "$base" >>"$folder/log" 2>&1 ||
        nothing_is_tried "The base image $base is not here, and no registry gives it to $engine"
}
choose_composer() {
    compose=${COMPOSE:-}
    if [ -n "$compose" ]; then
        :
    elif [ "$engine" = docker ] && docker compose version >/dev/null 2>&1; then
        compose="docker compose"
    elif [ "$engine" = podman ] && waits_for_others podman-compose; then
        compose=podman-compose
    fi
}
# can_compose: there is a composer, and the image that it starts
can_compose() {
    if [ -z "$compose" ]; then
        not_tried "compose, machines: there is no \`docker compose\`, or for Podman no podman-compose from 1.1 on"
        return 1
    fi
    try "the image of every process is built" build fleet || return 1
    ok "the image of every process: $(megabytes "$name-fleet") MB"
}

main() {
    local part
    [ -x "$python" ] || { echo "image.sh: no .venv here: make .venv/.installed-dev" >&2; exit 1; }
    for part in $parts; do
        case $part in
        demo | workshop | compose | machines) ;;
        *) echo "image.sh: no part $part: demo, workshop, compose or machines" >&2; exit 1 ;;
        esac
    done
    mkdir -p "$folder"
    : >"$folder/log"
    choose_engine
    choose_composer
    address=$(hostname -I | cut -d " " -f 1)
    export PECKORDER_IMAGE=$name-fleet
    clean
    trap clean EXIT
    trap 'exit 130' INT TERM
    echo "$("$engine" --version), base $base${compose:+, $compose}"
    case " $parts " in
    *" compose "* | *" machines "*)
        can_compose || parts=$(printf '%s\n' $parts | grep -vx 'compose\|machines' || true)
        ;;
    esac
    for part in $parts; do "$part"; done
    [ "$failed" = 0 ] || { echo "$failed checks have failed"; exit 1; }
    echo "all that was tried is well"
}
# Read to its end before it begins: an editor may write this file while it runs.
main; exit
