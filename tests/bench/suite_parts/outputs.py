"""Bytes and bits per voxel of one grid in many formats, and speeds of the container's codecs."""
import gzip
import json
import pathlib
import re

from .programs import Daemon, Skipped

# Outputs of voxel: name, extension, flags.
OWN = [("native fast", "voxg", ["--codec", "fast"]), ("native small", "voxg", ["--codec", "small"]),
       ("npz", "npz", []), (".vox", "vox", [])]
# Outputs of grid_sizes: occupancy alone.
OTHERS = ["NanoVDB none", "NanoVDB zip", "NanoVDB blosc", "OpenVDB zip", "OpenVDB blosc", "binvox",
          "binvox + gzip"]
CODEC_LINE = re.compile(
    r"^\s+(\w+)\s+(fast|small)\s+([\d.]+) bits/voxel\s+(\d+) bytes\s+encode\s+([\d.]+) Mvoxel/s\s+"
    r"([\d.]+) MB/s\s+decode\s+([\d.]+) Mvoxel/s\s+([\d.]+) MB/s")


def sizes_table(context, scenes, sizes):
    rows = []
    with Daemon(context.programs, context.driver) as daemon:
        for scene in scenes:
            for size in sizes:
                for channels in ["occupancy"] + (["occupancy,color"] if scene.colored else []):
                    rows += _formats(context, daemon, scene, size, channels)
    return rows


def _formats(context, daemon, scene, size, channels):
    def row(name, **cells):
        return {"scene": scene.key, "size": size, "channels": channels, "who": name, **cells}

    geometry = channels == "occupancy"
    if scene.skipped:
        names = [name for name, _, _ in OWN] + (OTHERS if geometry else [])
        return [row(name, skipped=scene.skipped) for name in names]
    files, skips = {}, {}
    for number, (name, extension, flags) in enumerate(OWN):
        path = context.programs.scratch / f"sizes{number}.{extension}"
        try:
            context.programs.run("voxel", scene.file, "-o", path, "--url", daemon.url, "--size", size,
                                 "--channels", channels, "-q", *flags)
            files[name] = path
        except Skipped as reason:
            skips[name] = str(reason)
    voxels = 0
    try:
        voxels = _voxels(context, files)
        if geometry:
            others, missing = _others(context, files["native fast"])
            files |= others
            skips |= missing
    except (Skipped, KeyError) as reason:
        skips |= {name: str(reason) for name in OTHERS if geometry}
    rows = [row(name, bytes=path.stat().st_size, voxels=voxels,
                bits_per_voxel=8 * path.stat().st_size / max(voxels, 1))
            for name, path in files.items()]
    for path in files.values():
        path.unlink()
    return rows + [row(name, skipped=reason) for name, reason in skips.items()]


def _voxels(context, files):
    return json.loads(context.programs.run("voxel", "info", files["native fast"], "--json").output)[
        "voxel_count"]


def _others(context, container):
    written = json.loads(
        context.programs.run("grid_sizes", container, context.programs.scratch).output)["files"]
    files = {name: pathlib.Path(path) for name, path in written.items()}
    packed = files["binvox"].with_suffix(".gz")
    packed.write_bytes(gzip.compress(files["binvox"].read_bytes(), 9, mtime=0))
    files["binvox + gzip"] = packed
    return files, {name: "grid_sizes is built without it" for name in OTHERS if name not in files}


def codecs_table(context, scenes, sizes):
    """Encoding and decoding of the container's streams on one core."""
    rows = []
    with Daemon(context.programs, context.driver) as daemon:
        for scene in scenes:
            for size in sizes:
                try:
                    rows += _codecs(context, daemon, scene, size)
                except Skipped as reason:
                    rows.append({"scene": scene.key, "size": size, "who": "codecs",
                                 "skipped": str(reason)})
    return rows


def _codecs(context, daemon, scene, size):
    if scene.skipped:
        raise Skipped(scene.skipped)
    path = context.programs.scratch / "codecs.voxg"
    channels = "occupancy,color,normal" if scene.colored else "occupancy"
    context.programs.run("voxel", scene.file, "-o", path, "--url", daemon.url, "--size", size,
                         "--channels", channels, "-q")
    output = context.programs.run("small_codec_bench", "--repeat", context.runs, path).output
    path.unlink()
    names = ("bits_per_voxel", "bytes", "encode_mvoxel_s", "encode_mb_s", "decode_mvoxel_s",
             "decode_mb_s")
    rows = [{"scene": scene.key, "size": size, "who": f"{match[1]}, {match[2]}",
             **{name: float(value) for name, value in zip(names, match.groups()[2:])}}
            for match in map(CODEC_LINE.match, output.splitlines()) if match]
    if not rows:
        raise Skipped("small_codec_bench printed no line of the known form")
    return rows
