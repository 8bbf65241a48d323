#!/usr/bin/python3
"""How long the Python package takes from the bytes of a grid to its arrays.

    tests/bench/python_decode.py MESH [--size 1024] [--rounds 15]

Prints the bytes, the first and the median time in milliseconds: of the decoder, and of the .npz that is used without
it, with its conversion by the server. VOXELD_BIN_DIR chooses the daemon and the decoder."""
import argparse
import pathlib
import statistics
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import Daemon  # noqa: E402  (needs the path above)
import python_package  # noqa: E402, F401: finds voxeld
import voxeld  # noqa: E402
from voxeld import _decode  # noqa: E402
from voxeld._call import Call  # noqa: E402


def show(name, size, times_ms):
    print(f"{name:32} {size / 1e6:6.1f} MB   first {times_ms[0]:6.0f}   median {statistics.median(times_ms):6.0f} ms")


def times_of(work, rounds):
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        work()
        times.append((time.perf_counter() - begin) * 1000)
    return times


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh")
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    assert voxeld.has_decoder()
    daemon = Daemon(device="cpu")
    try:
        client = voxeld.Client(daemon.url)
        for channels in (["occupancy"], ["normal"]):
            grid = client.voxelize(arguments.mesh, size=arguments.size, channels=channels)
            names = [name for name in channels if name != "occupancy"]
            data = client._export(Call(), {"grid": grid.id}, {"format": "native"})

            def arrays(decoded):
                return [decoded.coords(), *(decoded.rows(name) for name in names)]

            def sparse():
                options = {"format": "npz", "layout": "sparse", "cache": False}
                archive = client._export(Call(), {"grid": grid.id}, options)
                arrays(_decode.SparseArrays(archive))
                return archive

            name = " ".join(["coords", *names])
            show(f"{name}: decoder", len(data), times_of(lambda: arrays(_decode.decode(data)), arguments.rounds))
            size = len(sparse())
            show(f"{name}: npz of the server", size, times_of(sparse, max(arguments.rounds // 5, 1)))
        print(f"{grid.voxel_count} voxels")
    finally:
        daemon.stop()


if __name__ == "__main__":
    main()
