# What units.sh runs in its container, as root, once that has booted; then it powers off.
# Prints a line per check; the last one says how it ended.
trap 'systemctl poweroff' EXIT
failed=0

ok() {
    echo "ok     $*"
}

fails() {
    echo "FAILS  $*"
    failed=$((failed + 1))
}

# wait_for SECONDS WHAT COMMAND...: until the command succeeds
wait_for() {
    local limit=$1 what=$2 since=$SECONDS
    shift 2
    until "$@" >/dev/null 2>&1; do
        if ((SECONDS - since >= limit)); then
            fails "$what: not within $limit s"
            return 1
        fi
        sleep 0.2
    done
    ok "$what after $((SECONDS - since)) s"
}

pid_of() {
    systemctl show -P MainPID "$1"
}

is_another_than() {
    local now
    now=$(pid_of "$2")
    [ "$now" != 0 ] && [ "$now" != "$1" ] && systemctl -q is-active "$2"
}

# comes_back SECONDS SIGNAL UNIT: after a signal it runs again, as another process
comes_back() {
    local before
    before=$(pid_of "$3")
    if [ "$before" = 0 ]; then
        fails "$3 does not run"
        return 1
    fi
    kill "-$2" "$before"
    wait_for "$1" "$3 is back after SIG$2" is_another_than "$before" "$3"
}

said() {
    journalctl -q -u "$1" --grep "$2" | grep -q .
}

waits() {
    [ "$(systemctl show -P ActiveState "$1")" = activating ] &&
        systemctl show -P StatusText "$1" | grep -q 'looks for the bus'
}

rests() {
    systemctl show -P StatusText "$1" | grep -q 'left its mission'
}

on_the_bus() {
    systemctl show -P StatusText "$1" | grep -q 'on the bus'
}

ended() {
    [ "$(systemctl show -P ActiveState "$1")" = inactive ]
}

exposure() {
    local line
    line=$(systemd-analyze security --no-pager --threshold=20 "$1" | tail -n 1)
    if [ "${PIPESTATUS[0]}" = 0 ]; then ok "${line#→ }"; else fails "${line#→ }"; fi
}

agents="peckorder-agent@uav1 peckorder-agent@uav2 peckorder-agent@uav3"
services="peckorder-router peckorder-coordinator peckorder-dashboard $agents"
echo "$(systemctl --version | head -n 1), $(python3 --version), kernel $(uname -r)"

for n in 1 2 3; do
    systemd-run -q --unit="autopilot-uav$n" /opt/peckorder/bin/swarm autopilot \
        /etc/peckorder/coordinator.toml --uav "uav$n" --listen "tcp:127.0.0.1:576$n" \
        --signing-key "/root/uav$n.key"
done
systemctl start --no-block $agents
for agent in $agents; do
    wait_for 15 "$agent waits for a router" waits "$agent"
done
systemctl start peckorder-router && ok "router: $(systemctl show -P StatusText peckorder-router)"
for agent in $agents; do
    wait_for 15 "$agent is ready" systemctl -q is-active "$agent"
done
systemctl start peckorder-dashboard &&
    ok "dashboard: $(systemctl show -P StatusText peckorder-dashboard)"
systemctl start peckorder-coordinator &&
    ok "coordinator: $(systemctl show -P StatusText peckorder-coordinator)"
for service in $services; do exposure "$service"; done

wait_for 90 "the mission runs" said peckorder-agent@uav1 'mission runs' || exit 1
comes_back 10 KILL peckorder-agent@uav1
comes_back 25 STOP peckorder-agent@uav2
comes_back 15 KILL peckorder-coordinator
comes_back 10 KILL peckorder-router
comes_back 25 STOP peckorder-router
comes_back 15 KILL peckorder-dashboard
wait_for 300 "the mission ends" said peckorder-coordinator 'mission ends'
if said peckorder-coordinator 'every task has ended'; then
    ok "every task has ended"
else
    fails "tasks are left"
fi
for agent in $agents; do
    wait_for 200 "$agent is home" rests "$agent"
done
wait_for 60 "the coordinator has left, and is not started anew" ended peckorder-coordinator
for agent in $agents; do
    wait_for 60 "$agent is ready for the next mission" on_the_bus "$agent"
done
since=$SECONDS
systemctl stop $agents peckorder-router peckorder-dashboard
ok "all stopped within $((SECONDS - since)) s"
if [ "$failed" = 0 ]; then echo "all is well"; else echo "$failed checks have failed"; fi
