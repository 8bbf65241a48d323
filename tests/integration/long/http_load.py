"""The load that test_http_load (short) and tests/bench/http_load.py (long) put on a daemon."""
import json
import subprocess
import time

from harness import BIN

LOAD = BIN / "voxeld_http_load"


def resident_bytes(pid):
    with open(f"/proc/{pid}/status") as status:
        for line in status:
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) * 1024
    raise AssertionError("no VmRSS")


def run(*arguments):
    return json.loads(subprocess.run([LOAD, *map(str, arguments)], check=True, text=True,
                                     capture_output=True).stdout)


class Holding:
    """Idle and slow connections while the block runs."""

    def __init__(self, port, idle, slow):
        self.arguments = [LOAD, "hold", str(port), str(idle), str(slow)]

    def __enter__(self):
        self.process = subprocess.Popen(self.arguments, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "ready\n"
        return self

    def __exit__(self, *_):
        out, _ = self.process.communicate("")
        self.facts = json.loads(out)


def measure(daemon, asset, job, idle, slow, queued, seconds):
    """Measures other clients while `idle` and `slow` connections are held and `queued` jobs wait."""
    giants = [daemon.submit(kind="voxelize", asset=asset,
                            options={"size": 1500 + i, "cache": "no", "fill": "solid"})
              for i in range(6)]  # one of them runs all the time
    daemon.wait_state(giants[0], "running")
    waiting = []
    submitted = time.monotonic()
    for i in range(queued):
        waiting.append(daemon.submit(kind="voxelize", asset=asset,
                                     options={"size": 8 + i % 50, "cache": "no"}))
    facts = {"idle": idle, "slow": slow, "queued": queued,
             "submit_ms": (time.monotonic() - submitted) * 1000 / queued}
    before = resident_bytes(daemon.process.pid)
    with Holding(daemon.port, idle, slow) as holding:
        facts["livez"] = run("probe", daemon.admin_port, "/livez", seconds)
        facts["cached_get"] = run("probe", daemon.port, f"/v1/jobs/{job}/result", seconds,
                                  "Range: bytes=0-63")
        facts["rss_growth_mb"] = (resident_bytes(daemon.process.pid) - before) / 1e6
        times = []
        for victim in waiting[-20:]:
            start = time.monotonic()
            assert daemon.request("DELETE", f"/v1/jobs/{victim}").json()["state"] == "cancelled"
            times.append((time.monotonic() - start) * 1000)
        facts["cancel_max_ms"] = max(times)
        for victim in waiting + giants[1:]:
            daemon.request("DELETE", f"/v1/jobs/{victim}")
        start = time.monotonic()
        daemon.request("DELETE", f"/v1/jobs/{giants[0]}")
        for giant in giants:
            daemon.wait(giant)
        facts["cancel_running_ms"] = (time.monotonic() - start) * 1000
        start = time.monotonic()
        small = daemon.submit(kind="voxelize", asset=asset, options={"size": 32, "cache": "no"})
        assert daemon.wait(small)["state"] == "done"
        facts["small_job_ms"] = (time.monotonic() - start) * 1000
    facts.update(holding.facts)
    return facts
