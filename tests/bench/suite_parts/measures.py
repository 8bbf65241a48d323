"""Times: voxelization alone, by pipeline, driver and rival; stages of a request; whole processes.

Every function gives rows: scene, size, who, and either numbers or why there are none ("skipped").
"""
import pathlib
import statistics

from .programs import Daemon, Skipped

ISAS = ["portable", "sse4", "avx2", "avx512"]
BESIDE = "cpu, beside the rivals"
RIVALS = {"recast": "Recast", "openvdb": "OpenVDB", "vtk": "VTK"}


def skipped(scene, size, who, why):
    return {"scene": scene.key, "size": size, "who": who, "skipped": why}


def fill_in(rows, scene, sizes, who, why):
    """Adds a row with the reason for every size that has none."""
    there = {row["size"] for row in rows}
    return rows + [skipped(scene, size, who, why) for size in sizes if size not in there]


def add_ratios(rows, own="cpu"):
    """How many times as long as `own`, at the same scene and size."""
    base = {(row["scene"], row["size"]): row["ms"] for row in rows
            if row["who"] == own and "ms" in row}
    for row in rows:
        reference = base.get((row["scene"], row["size"]))
        if reference and "ms" in row:
            row.setdefault("ratio", row["ms"] / reference)
    return rows


def voxelize(context, scene, sizes, pipeline, driver, options=()):
    """One pipeline on one driver; driver None: pipeline cpu, which needs none."""
    who = pipeline if driver is None else f"{pipeline} on {driver}"
    if scene.skipped:
        return fill_in([], scene, sizes, who, scene.skipped)
    if driver in context.dead_drivers:
        return fill_in([], scene, sizes, who, context.dead_drivers[driver])
    found, why = context.programs.json_rows(
        "voxelize_bench", scene.source, "--pipeline", pipeline, "--device", driver or "cpu",
        "--repeat", context.runs, "--hash", *options, *sizes)
    rows = [{"scene": scene.key, "size": row["size"], "who": who, "driver": row["device"],
             **{name: row[name] for name in ("ms", "min_ms", "runs", "peak_mb", "device_mb", "voxels",
                                             "bricks", "cells", "triangles", "vertices", "passes", "hash",
                                             "isa", "pipeline")}} for row in found]
    return fill_in(rows, scene, sizes, who, why or "no result")


def rivals(context, scene, sizes, solid):
    """voxeld's pipeline cpu and the rivals in one run."""
    names = [name for name in RIVALS if name != ("recast" if solid else "vtk")]
    who = {"voxeld cpu": BESIDE} | {name: RIVALS[name] for name in names}
    if scene.skipped:
        return [skipped(scene, size, label, scene.skipped)
                for label in who.values() for size in sizes]
    flags = ["--solid", "--sign", "parity"] if solid else []
    found, why = context.programs.json_rows(
        "rivals_bench", scene.source, *flags, "--runs", context.runs,
        *[size for size in sizes if size <= context.rival_size_max])
    rows = []
    for name, label in who.items():
        own = [{"scene": scene.key, "size": row["size"], "who": label,
                **{k: row[k] for k in ("ms", "ratio", "peak_mb", "voxels", "skipped") if row.get(k)}}
               for row in found if row["voxelizer"] == name]
        for size in [s for s in sizes if s > context.rival_size_max]:
            own.append(skipped(scene, size, label, context.why_not_rival()))
        missing = why or f"rivals_bench is built without {label}"
        rows += fill_in(own, scene, sizes, label, missing)
    return rows


def voxelize_table(context, scenes, sizes):
    rows = []
    for scene in scenes:
        rows += voxelize(context, scene, sizes, "cpu", None)
        for driver in context.drivers:
            for pipeline in ("compute", "raster"):
                rows += voxelize(context, scene, sizes, pipeline, driver)
        rows += rivals(context, scene, sizes, False)
    return add_ratios(rows)


def attributes_table(context, scenes, sizes):
    """Pipeline cpu with occupancy alone, and with colour where the scene has one, else normals."""
    rows = []
    for scene in scenes:
        attribute = "color" if scene.colored else "normal"
        for who, channels in (("occupancy", "occupancy"), ("attributes", f"occupancy,{attribute}")):
            for row in voxelize(context, scene, sizes, "cpu", None, ["--channels", channels]):
                rows.append(row | {"who": who})
    return add_ratios(rows, own="occupancy")


def solid_table(context, scenes, sizes):
    rows = []
    for scene in scenes:
        rows += rivals(context, scene, sizes, True)
    return rows


def stages_table(context, scenes, sizes, request):
    """`request`: breakdown.request."""
    rows = []
    with Daemon(context.programs, context.driver) as daemon:
        for scene in scenes:
            for size in sizes:
                rows.append(_stages(context, daemon, scene, size, request))
    return rows


def _stages(context, daemon, scene, size, request):
    who = f"daemon on {context.driver}"
    if scene.skipped:
        return skipped(scene, size, who, scene.skipped)
    query = (f"size={size}&format=native&cache=no&channels=occupancy"
             f"&filename={pathlib.Path(scene.file).name}")
    try:
        runs = [request(daemon.url, scene.file, query) for _ in range(context.runs + 1)][1:]
    except (RuntimeError, OSError) as reason:
        return skipped(scene, size, who, str(reason)[:300])
    names = dict.fromkeys(name for _, stages, _ in runs for name in stages)
    return {"scene": scene.key, "size": size, "who": who,
            "ms": statistics.median(client for client, _, _ in runs),
            "stages": {name: statistics.median(stages.get(name, 0) for _, stages, _ in runs)
                       for name in names},
            "bytes": runs[-1][2]}


def whole_table(context, scenes, sizes):
    """From a PLY file to a file on disk: start to end of the process."""
    rows = []
    with Daemon(context.programs, context.driver) as daemon:
        for scene in scenes:
            for size in sizes:
                for codec, who in (("fast", "voxel"), ("small", "voxel, codec small")):
                    arguments = [scene.ply, "-o", context.programs.scratch / "whole.voxg", "--url",
                                 daemon.url, "--size", size, "--channels", "occupancy", "--cache",
                                 "no", "--codec", codec, "-q"]
                    row = _whole(context, scene, size, who, "voxel", arguments)
                    if "ms" in row:
                        row["daemon_peak_mb"] = daemon.peak_mb()
                    rows.append(row)
    for scene in scenes:
        for size in sizes:
            for name in ("recast", "openvdb"):
                out = context.programs.scratch / f"whole.{name}"
                rows.append(_whole(context, scene, size, RIVALS[name], f"{name}_process",
                                   [scene.ply, size, out]))
    return add_ratios(rows, own="voxel")


def _whole(context, scene, size, who, program, arguments):
    if scene.skipped:
        return skipped(scene, size, who, scene.skipped)
    if size > context.rival_size_max and program != "voxel":
        return skipped(scene, size, who, context.why_not_rival())
    out = next(a for a in reversed(arguments) if isinstance(a, pathlib.Path))
    try:
        runs = [context.programs.run(program, *arguments) for _ in range(context.runs + 1)][1:]
    except Skipped as reason:
        return skipped(scene, size, who, str(reason))
    row = {"scene": scene.key, "size": size, "who": who,
           "ms": statistics.median(run.milliseconds for run in runs), "runs": len(runs),
           "peak_mb": max(run.peak_mb for run in runs), "bytes": out.stat().st_size}
    out.unlink()
    return row
