#!/usr/bin/python3
"""Whether the time of a request tells that another tenant has the same bytes.

    tests/bench/existence.py [--megabytes 4,64] [--rounds 40]

Deletes and uploads the same bytes in turn with and without another tenant's copy, on one daemon, and prints
medians and quartiles in milliseconds. VOXELD_BIN_DIR chooses the daemon."""
import argparse
import os
import pathlib
import statistics
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import TenantsDaemon  # noqa: E402  (needs the path above)


def mesh(megabytes):
    return (b"# " + os.urandom(megabytes << 19).hex().encode() +
            b"\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def timed(call, *statuses):
    begin = time.perf_counter()
    response = call()
    ms = (time.perf_counter() - begin) * 1000
    assert response.status in statuses, response.body
    return ms, response


def upload(tenant, body):
    return timed(lambda: tenant.post("/v1/assets?filename=a.obj", body), 200, 201)


def round_of(lab, studio, megabytes, is_shared):
    body = mesh(megabytes)
    if is_shared:
        upload(studio, body)
        time.sleep(0.1)
    upload_ms, response = upload(lab, body)
    path = "/v1/assets/" + response.json()["id"]
    time.sleep(0.1)
    delete_ms, _ = timed(lambda: lab.request("DELETE", path), 204)
    time.sleep(0.1)
    if is_shared:
        studio.request("DELETE", path)
    return upload_ms, delete_ms


def text(values):
    low, middle, high = statistics.quantiles(values, n=4)
    return f"{middle:8.2f} ({low:.2f} to {high:.2f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--megabytes", default="4,64")
    parser.add_argument("--rounds", type=int, default=40)
    arguments = parser.parse_args()
    with TenantsDaemon({"lab": 1, "studio": 1}) as tenants:
        lab, studio = tenants.tenants["lab"], tenants.tenants["studio"]
        for megabytes in map(int, arguments.megabytes.split(",")):
            times = {False: [], True: []}
            for i in range(2 * arguments.rounds):  # side by side: the machine is the same for both
                times[i % 2 == 1].append(round_of(lab, studio, megabytes, is_shared=i % 2 == 1))
            for k, what in enumerate(("upload", "delete")):
                print(f"{megabytes:3d} MB {what}, ms: {text([t[k] for t in times[False]])} alone,"
                      f" {text([t[k] for t in times[True]])} where another tenant has the bytes", flush=True)


if __name__ == "__main__":
    main()
