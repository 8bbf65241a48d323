"""Arrays and meshes: what a request for one takes beside numpy's own compression, and a plain write.

Rows as in measures.py: encode_ms and store_ms are stages of the request, bytes those of the file.
"""
import io
import os
import pathlib
import statistics
import time

from .measures import add_ratios, skipped
from .programs import Daemon

# Who: options of the request. Attributes are colour where the scene has a texture, else normals.
FORMATS = {"npy": "format=npy", "npz": "format=npz", "npz, attributes": "format=npz",
           "npy, sparse": "format=npy&layout=sparse", "npz, sparse": "format=npz&layout=sparse",
           "npz, sparse, attributes": "format=npz&layout=sparse",
           "glb": "format=glb", "glb, faces": "format=glb&mesh=faces",
           "glb, smooth": "format=glb&mesh=smooth", "ply": "format=ply", "obj": "format=obj",
           "glb, attributes": "format=glb"}
TEXTURED = {"spot", "bob"}
NUMPY = "numpy.savez_compressed"
PLAIN_WRITE = "write of the npy"
CELLS_MAX = 2 ** 31  # of dense formats


def dense_table(context, scenes, sizes, request):
    """`request`: breakdown.request."""
    rows = []
    sizes = [size for size in sizes if size ** 3 <= CELLS_MAX]
    with Daemon(context.programs, "cpu") as daemon:
        for scene in scenes:
            for size in sizes:
                rows += _of_scene(context, daemon, scene, size, request)
    return add_ratios(rows, own="npz")


def _of_scene(context, daemon, scene, size, request):
    def row(who, runs, size_bytes, **more):
        return {"scene": scene.key, "size": size, "who": who, "ms": statistics.median(runs),
                "bytes": size_bytes, **more}

    if scene.skipped:
        return [skipped(scene, size, who, scene.skipped) for who in (*FORMATS, NUMPY, PLAIN_WRITE)]
    rows, array = [], context.programs.scratch / "dense.npy"
    attribute = "color" if scene.key in TEXTURED else "normal"
    for who, options in FORMATS.items():
        channels = f"occupancy,{attribute}" if who.endswith("attributes") else "occupancy"
        query = (f"size={size}&{options}&pipeline=cpu&cache=no&channels={channels}"
                 f"&filename={pathlib.Path(scene.file).name}")
        keep = array if who == "npy" else None
        try:
            runs = [request(daemon.url, scene.file, query, keep)
                    for _ in range(context.runs + 1)][1:]
        except (RuntimeError, OSError) as reason:
            rows.append(skipped(scene, size, who, str(reason)[:300]))
            continue
        encode = [stages.get("encode", 0) for _, stages, _ in runs]
        store = statistics.median(stages.get("store", 0) for _, stages, _ in runs)
        rows.append(row(who, encode, runs[-1][2], store_ms=store))
    rows += _rivals(context, scene, size, array, row)
    array.unlink(missing_ok=True)
    return rows


def _rivals(context, scene, size, array, row):
    if not array.exists():
        return [skipped(scene, size, who, "no npy") for who in (NUMPY, PLAIN_WRITE)]
    plain = array.read_bytes()
    writes = []
    for _ in range(context.runs):
        begin = time.perf_counter()
        with open(context.programs.scratch / "plain", "wb") as out:
            out.write(plain)
        writes.append((time.perf_counter() - begin) * 1e3)
        os.unlink(context.programs.scratch / "plain")
    rows = [row(PLAIN_WRITE, writes, len(plain))]
    del plain
    try:
        import numpy
    except ImportError:
        return rows + [skipped(scene, size, NUMPY, "numpy is not installed")]
    if size > context.rival_size_max:
        return rows + [skipped(scene, size, NUMPY, context.why_not_rival())]
    occupancy = numpy.load(array)
    begin = time.perf_counter()
    out = io.BytesIO()
    numpy.savez_compressed(out, occupancy=occupancy)
    return rows + [row(NUMPY, [(time.perf_counter() - begin) * 1e3], out.tell())]
