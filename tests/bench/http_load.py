#!/usr/bin/env python3
"""The HTTP server under load: 10,000 idle and 1,000 slow connections beside a queue of jobs, and its
throughput beside nginx's in the same run.

  tests/bench/http_load.py [--bin DIR] [--idle N] [--slow N] [--queued N] [--seconds S] [--no-nginx]
                            [--repeats N] [--no-held]

Prints JSON. Needs a limit on open files (ulimit -Hn) of idle + slow + 600, and for the comparison
nginx (nginx-light). The file of 100 MB and the response of 64 bytes are parts of uploads' results.
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
# Before the folder of this file, which has the name of the module that it imports.
sys.path[:0] = [str(ROOT / "tests/integration/long"), str(ROOT / "tests/integration")]

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


def beside(runs, repeats):
    """Each of the two in turn, so many times: rates by name, and the ratios of the pairs."""
    rates = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            rates[name].append(run())
    ratios = sorted(round(one / other, 3) for one, other in zip(rates["voxeld"], rates["nginx"]))
    return {**{name: sorted(values) for name, values in rates.items()}, "ratios": ratios,
            "ratio": ratios[len(ratios) // 2]}


def throughput(http_load, daemon, small, large, seconds, repeats):
    folder = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-nginx-"))
    (folder / "files").mkdir()
    (folder / "files/small").write_bytes(b"x" * 64)
    (folder / "files/large").write_bytes(daemon.get(large).body)
    nginx = Nginx(folder)

    def rate(port, path, connections, key, *headers):
        return lambda: http_load.run("rate", port, path, seconds, connections, *headers)[key]

    facts = {}
    try:
        for connections in (1, 8, 32):
            facts[f"get_64_bytes_c{connections}"] = beside({
                "voxeld": rate(daemon.port, small, connections, "per_second", "Range: bytes=0-63"),
                "nginx": rate(nginx.port, "/small", connections, "per_second")}, repeats)
        for connections in (1, 4):
            facts[f"download_mb_per_s_c{connections}"] = beside({
                "voxeld": rate(daemon.port, large, connections, "mb_per_second"),
                "nginx": rate(nginx.port, "/large", connections, "mb_per_second")}, repeats)
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
    parser.add_argument("--repeats", type=int, default=5, help="pairs of runs beside nginx")
    parser.add_argument("--no-nginx", action="store_true")
    parser.add_argument("--no-held", action="store_true", help="only what is beside nginx")
    arguments = parser.parse_args()
    os.environ["VOXELD_BIN_DIR"] = arguments.bin
    import http_load
    from harness import daemon_with_fixtures
    options = ["--log-level", "warn", "--queued-jobs-max", str(arguments.queued + 6)]
    with daemon_with_fixtures(arguments=options) as (daemon, fixtures):
        asset = daemon.upload(fixtures / "sample.glb")
        job = daemon.submit(kind="voxelize", asset=asset, options={"size": 16})
        daemon.wait(job)
        facts = {"cores": os.cpu_count(), "load_before": os.getloadavg()[0]}
        if not arguments.no_nginx and shutil.which("nginx"):
            facts.update(throughput(http_load, daemon, f"/v1/jobs/{job}/result",
                                    large_result(daemon, asset), min(arguments.seconds, 4),
                                    arguments.repeats))
        if not arguments.no_held:
            facts["held"] = http_load.measure(daemon, asset, job, arguments.idle, arguments.slow,
                                               arguments.queued, arguments.seconds)
        facts["load_after"] = os.getloadavg()[0]
        print(json.dumps(facts, indent=1))


if __name__ == "__main__":
    main()
