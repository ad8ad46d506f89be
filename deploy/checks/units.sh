#!/bin/sh
# Boot a real systemd in a container, install a fleet there as a user would, and see it fly: units
# get ready, one that is killed or hangs comes back, and the mission is finished all the same.
#
#     sudo deploy/checks/units.sh [FOLDER]          (make check-units)
#
# Needs root, debootstrap and systemd-nspawn (Debian: debootstrap, systemd-container), the
# project's .venv with its build tools, a package index and a Debian mirror. FOLDER, by default
# build/check-units, keeps the container's file system for the next time (1 GB). The container
# has processes, mounts, users and journal of its own, and no network but its own loopback.
#
# What this cannot show: limits of memory, processor and processes, and which devices a service may
# open, are set in control groups, which a container has only where the machine's own systemd
# hands them on.
set -eu

project=$(cd "$(dirname "$0")/../.." && pwd)
folder=${1:-$project/build/check-units}
root=$folder/root
python=$project/.venv/bin/python
swarm=$project/.venv/bin/swarm
suite=bookworm

for program in debootstrap systemd-nspawn; do
    command -v "$program" >/dev/null || { echo "units.sh: $program is missing" >&2; exit 1; }
done
[ "$(id -u)" = 0 ] || { echo "units.sh: only root can boot a container" >&2; exit 1; }

mkdir -p "$folder"
if [ ! -e "$root/.complete" ]; then
    echo "making a Debian $suite in $root"
    rm -rf "$root"
    debootstrap --variant=minbase \
        --include=systemd,systemd-sysv,dbus,python3,python3-venv,procps \
        "$suite" "$root" >"$folder/debootstrap.log"
    touch "$root/.complete"
fi
version='import sys; print("%d.%d" % sys.version_info[:2])'
if [ "$("$python" -c "$version")" != "$(chroot "$root" python3 -c "$version")" ]; then
    echo "units.sh: .venv needs the Python of Debian $suite: $(chroot "$root" python3 -V)" >&2
    exit 1
fi

echo "installing this tree into it"
wheels=$folder/wheels
rm -rf "$root"/etc/peckorder "$root"/var/lib/peckorder "$root"/var/log/journal
rm -rf "$root"/etc/systemd/system/*peckorder* "$root"/etc/systemd/system/*/*peckorder*
rm -f "$wheels"/peckorder-*.whl
PATH=$project/.venv/bin:$PATH "$python" -m pip wheel -q --no-deps --no-build-isolation \
    -w "$wheels" "$project"
"$python" -m pip download -q --only-binary :all: -d "$wheels" "$wheels"/peckorder-*.whl 2>&1 |
    grep -v '^WARNING: Location' || true
cp -R "$wheels" "$root/wheels"
chroot "$root" python3 -m venv /opt/peckorder
chroot "$root" /opt/peckorder/bin/pip uninstall -q -y peckorder 2>/dev/null || true
chroot "$root" /opt/peckorder/bin/pip install -q --no-index --find-links /wheels peckorder
rm -rf "$root/wheels"

echo "making keys, and installing router, coordinator, dashboard and three agents"
scenario=$folder/field.toml
keys=$folder/keys
rm -rf "$keys"
# Slower than it is shipped, so that there is time for what goes wrong.
sed 's/^speed_m_s = .*/speed_m_s = 2.5/' "$project/sim/scenarios/meadow.toml" >"$scenario"
"$swarm" keys init "$scenario" --out "$keys" >/dev/null
install() {
    "$swarm" install "$@" --root "$root" >>"$folder/install.log"
}
: >"$folder/install.log"
install router --keys "$keys/router"
install coordinator "$scenario" --keys "$keys/coordinator"
install dashboard --keys "$keys/dashboard"
for n in 1 2 3; do
    install agent --uav "uav$n" --mission meadow --keys "$keys/uav$n" \
        --mavlink "tcp:127.0.0.1:576$n" --system-id "$n" --signing-key "$keys/uav$n/mavlink.key"
    # Their autopilots are simulated in the container, under the same keys.
    cp "$keys/uav$n/mavlink.key" "$root/root/uav$n.key"
done

cp "$project/deploy/checks/in-container.sh" "$root/root/check.sh"
cat >"$root/etc/systemd/system/check.service" <<'UNIT'
[Unit]
After=multi-user.target
[Service]
ExecStart=/bin/bash /root/check.sh
StandardOutput=file:/root/result
StandardError=inherit
UNIT
mkdir -p "$root/etc/systemd/system/multi-user.target.wants" "$root/var/log/journal"
ln -sf ../check.service "$root/etc/systemd/system/multi-user.target.wants/check.service"
: >"$root/root/result"

echo "booting"
systemd-nspawn --quiet --boot --register=no --keep-unit --private-network \
    --machine=peckorder-check --directory="$root" </dev/null >"$folder/boot.log" 2>&1 ||
    { tail "$folder/boot.log" >&2; exit 1; }
cat "$root/root/result"
echo "journal: journalctl --directory=$root/var/log/journal"
tail -n 1 "$root/root/result" | grep -q '^all is well'
