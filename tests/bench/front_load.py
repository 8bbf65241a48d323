#!/usr/bin/env python3
"""The front under load: 10,000 idle and 1,000 slow connections beside a queue of jobs, and its
throughput beside nginx's in the same run.

  tests/bench/front_load.py [--bin DIR] [--idle N] [--slow N] [--queued N] [--seconds S] [--no-nginx]

Prints JSON. Needs a limit on open files (ulimit -Hn) of idle + slow + 600, and for the comparison
nginx (nginx-light). The file of 100 MB and the answer of 64 bytes are parts of uploads' results.
"""
import argparse
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/integration"))

LARGE_BYTES = 100_000_000


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Nginx:
    """Serves a folder as packaged, with as many processes as it takes."""

    def __init__(self, folder):
        self.port = free_port()
        (folder / "nginx.conf").write_text(f"""
daemon off; worker_processes auto; pid {folder}/nginx.pid; error_log {folder}/error.log;
events {{ worker_connections 1024; }}
http {{
  access_log {folder}/access.log; sendfile on; tcp_nodelay on; keepalive_requests 100000000;
  client_body_temp_path {folder}/b; proxy_temp_path {folder}/p; fastcgi_temp_path {folder}/f;
  uwsgi_temp_path {folder}/u; scgi_temp_path {folder}/s;
  server {{ listen 127.0.0.1:{self.port}; root {folder}/files; }}
}}
""")
        os.chmod(folder, 0o755)
        self.process = subprocess.Popen(["nginx", "-c", str(folder / "nginx.conf"), "-p", str(folder)],
                                        stderr=subprocess.DEVNULL)
        for _ in range(100):
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1).close()
                return
            except OSError:
                time.sleep(0.05)
        raise SystemExit("nginx does not start")

    def stop(self):
        self.process.terminate()
        self.process.wait(10)


def large_result(daemon, asset):
    """Path of a result that is LARGE_BYTES or more."""
    # 465^3 cells of one byte
    job = daemon.submit(kind="voxelize", asset=asset,
                        options={"dims": [465, 465, 465], "format": "npy"})
    status = daemon.wait(job, 600)
    assert status["state"] == "done" and status["result"]["bytes"] >= LARGE_BYTES, status
    return f"/v1/jobs/{job}/result"


def throughput(front_load, daemon, small, large, seconds):
    """Each of the two in turn, twice; the better one counts."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-nginx-"))
    (folder / "files").mkdir()
    (folder / "files/small").write_bytes(b"x" * 64)
    (folder / "files/large").write_bytes(daemon.get(large).body)
    nginx = Nginx(folder)
    facts = {}
    try:
        for connections in (1, 8, 32):
            rates = {"voxeld": [], "nginx": []}
            for _ in range(2):
                rates["voxeld"].append(front_load.run("rate", daemon.port, small, seconds, connections,
                                                      "Range: bytes=0-63")["per_second"])
                rates["nginx"].append(front_load.run("rate", nginx.port, "/small", seconds,
                                                     connections)["per_second"])
            best = {name: max(values) for name, values in rates.items()}
            facts[f"get_64_bytes_c{connections}"] = {
                **best, "ratio": round(best["voxeld"] / best["nginx"], 3)}
        for connections in (1, 4):
            rates = {"voxeld": [], "nginx": []}
            for _ in range(2):
                for name, port, path in (("voxeld", daemon.port, large), ("nginx", nginx.port, "/large")):
                    rates[name].append(front_load.run("rate", port, path, seconds,
                                                      connections)["mb_per_second"])
            best = {name: max(values) for name, values in rates.items()}
            facts[f"download_mb_per_s_c{connections}"] = {
                **best, "ratio": round(best["voxeld"] / best["nginx"], 3)}
    finally:
        nginx.stop()
        shutil.rmtree(folder, ignore_errors=True)
    return facts


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", default=str(ROOT / "build/dev/bin"))
    parser.add_argument("--idle", type=int, default=10_000)
    parser.add_argument("--slow", type=int, default=1_000)
    parser.add_argument("--queued", type=int, default=1_000)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--no-nginx", action="store_true")
    arguments = parser.parse_args()
    os.environ["VOXELD_BIN_DIR"] = arguments.bin
    import front_load
    from harness import Daemon, make_fixtures
    fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
    make_fixtures(fixtures)
    daemon = Daemon(device="cpu", arguments=("--log-level", "warn", "--queued-jobs-max",
                                             str(arguments.queued + 6)))
    try:
        asset = daemon.upload(fixtures / "sample.glb")
        job = daemon.submit(kind="voxelize", asset=asset, options={"size": 16})
        daemon.wait(job)
        facts = {"cores": os.cpu_count(), "load_before": os.getloadavg()[0]}
        if not arguments.no_nginx and shutil.which("nginx"):
            facts.update(throughput(front_load, daemon, f"/v1/jobs/{job}/result",
                                    large_result(daemon, asset), min(arguments.seconds, 4)))
        facts["held"] = front_load.measure(daemon, asset, job, arguments.idle, arguments.slow,
                                           arguments.queued, arguments.seconds)
        facts["load_after"] = os.getloadavg()[0]
        print(json.dumps(facts, indent=1))
    finally:
        daemon.stop()
        shutil.rmtree(fixtures, ignore_errors=True)


if __name__ == "__main__":
    main()
