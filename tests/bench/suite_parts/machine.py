"""The machine that the numbers were measured on."""
import datetime
import json
import os
import pathlib
import platform
import re
import subprocess

from .programs import Skipped


def processor():
    text = pathlib.Path("/proc/cpuinfo").read_text()
    match = re.search(r"model name\s*:\s*(.*)", text)
    return match.group(1) if match else platform.machine()


def revision(root):
    described = subprocess.run(["git", "-C", str(root), "describe", "--always", "--dirty"],
                            capture_output=True, text=True, check=False)
    return described.stdout.strip() or "unknown"


def describe(programs, root):
    memory = re.search(r"MemTotal:\s+(\d+)", pathlib.Path("/proc/meminfo").read_text())
    facts = {"processor": processor(), "cores": os.cpu_count(),
             "memory_gb": round(int(memory.group(1)) / 1e6, 1), "system": platform.platform(),
             "revision": revision(root), "load_before": os.getloadavg()[0],
             "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC")}
    try:
        facts |= json.loads(programs.run("bandwidth_bench").output)
    except Skipped as reason:
        facts["skipped"] = str(reason)
    return facts


def drivers(programs, wanted):
    """Names of those to measure, and of those that do not work the reason."""
    try:
        doctor = json.loads(programs.run("voxeld", "doctor", "--json").output)
    except (Skipped, ValueError) as reason:
        return wanted, {name: str(reason) for name in wanted}
    probes = {probe["device"]: probe for probe in doctor["devices"]}
    dead = {}
    for name in wanted:
        probe = probes.get(name)
        if probe is None:
            dead[name] = "no such device"
        elif not probe["works"]:
            dead[name] = probe.get("reason") or "does not work"
        elif name.startswith("egl:") and probe["is_software"]:
            dead[name] = f"no hardware: it is {probe['renderer']}"
    return wanted, dead
