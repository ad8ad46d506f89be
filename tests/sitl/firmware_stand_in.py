"""Programs that take real firmware's place on the command line, and fly simulated vehicles.

They accept exactly what the firmware would be started with, and open the same ports. PX4's
also runs a startup script that names files below its working folder as PX4's does: without
quotes, and by PATH. So all but the firmware itself is tried where there is none. Leaves out:
any behaviour of its own.
"""

from __future__ import annotations

import sys
from pathlib import Path

_ARDUCOPTER = """
import argparse, os, sys
parser = argparse.ArgumentParser(allow_abbrev=False)
for name in ("model", "speedup", "home", "defaults", "instance", "sysid"):
    parser.add_argument(f"--{name}", required=True)
told = parser.parse_args()
assert told.model == "+" and len(told.home.split(",")) == 4, told
assert "FRAME_CLASS 1" in open(told.defaults).read()
print("Waiting for connection ....", flush=True)
port = 5760 + 10 * int(told.instance)
os.execv(sys.executable, [
    *(sys.executable, "-m", "swarm", "autopilot", SCENARIO, "--json"),
    *("--uav", UAVS[int(told.instance)], "--system-id", told.sysid),
    *("--listen", f"tcp:127.0.0.1:{port}", "--speedup", told.speedup),
])
"""
_PX4 = """
import argparse, os, subprocess, sys
parser = argparse.ArgumentParser(allow_abbrev=False)
parser.add_argument("-i", dest="instance", required=True)
parser.add_argument("-s", dest="startup", required=True)
parser.add_argument("-d", dest="daemon", action="store_true", required=True)
parser.add_argument("data")
told = parser.parse_args()
assert os.environ["PX4_SIM_MODEL"] == "sihsim_quadx"
assert all(float(os.environ[f"PX4_HOME_{part}"]) for part in ("LAT", "LON", "ALT"))
os.symlink(told.data, "etc")
programs = os.path.dirname(os.path.abspath(sys.argv[0]))
os.environ["PATH"] = programs + ":" + os.environ["PATH"]
if subprocess.run(f"/bin/sh {told.startup} {told.instance}", shell=True).returncode:
    sys.exit("ERROR [px4] Startup script returned with an error")
port = 14540 + int(told.instance)
os.execv(sys.executable, [
    *(sys.executable, "-m", "swarm", "autopilot", SCENARIO, "--json", "--flavour", "px4"),
    *("--uav", UAVS[int(told.instance)], "--system-id", str(int(told.instance) + 1)),
    *("--listen", f"udpout:127.0.0.1:{port}", "--speedup", os.environ["PX4_SIM_SPEED_FACTOR"]),
])
"""
_PX4_STARTUP = """
here=$(pwd)/
. stand-in-alias.sh
PATH=$PATH:${here}etc/init.d-posix
airframe=
for file in ${here}etc/init.d-posix/airframes/*_sihsim_quadx; do
    [ -e "$file" ] && airframe=$file
done
if [ -z "$airframe" ]; then echo "Error: no autostart file found" >&2; exit 1; fi
. ${here}etc/init.d/rc.stand_in
. stand-in.rc
"""


def arducopter_stand_in(folder: Path, scenario: str, uavs: list[str]) -> Path:
    """A program for SWARM_SITL_ARDUCOPTER."""
    return _program(folder / "arducopter", _ARDUCOPTER, scenario, uavs)


def px4_stand_in(folder: Path, scenario: str, uavs: list[str]) -> Path:
    """A folder for SWARM_SITL_PX4."""
    posix, common, programs = (folder / name for name in ("etc/init.d-posix", "etc/init.d", "bin"))
    for each in (posix / "airframes", common, programs):
        each.mkdir(parents=True)
    (posix / "rcS").write_text(_PX4_STARTUP, encoding="utf-8")
    found = (programs / "stand-in-alias.sh", posix / "stand-in.rc", common / "rc.stand_in")
    for file in (*found, posix / "airframes" / "10040_sihsim_quadx"):
        file.touch()
    _program(folder / "bin" / "px4", _PX4, scenario, uavs)
    return folder


def _program(path: Path, text: str, scenario: str, uavs: list[str]) -> Path:
    head = f"#!{sys.executable}\nSCENARIO, UAVS = {scenario!r}, {uavs!r}\n"
    path.write_text(head + text, encoding="utf-8")
    path.chmod(0o755)
    return path
