"""The tables as one Markdown document."""
from . import dense, latency

# key: title, what stands in the rows' head, what in the columns' head, how a cell reads, note.
LAYOUTS = {}


def layout(key, title, head, column, cell, note):
    LAYOUTS[key] = (title, head, column, cell, note)


def number(value):
    """Three digits, or all before the point."""
    if value == 0:
        return "0"
    for limit, digits in ((100, 0), (10, 1), (1, 2), (0.1, 3)):
        if abs(value) >= limit:
            return f"{value:,.{digits}f}"
    return f"{value:.2g}"


def time_cell(row):
    ratio = f" ({number(row['ratio'])})" if "ratio" in row and row["ratio"] != 1 else ""
    return number(row["ms"]) + ratio


def whole_cell(row):
    memory = f"{row['peak_mb']:.0f}"
    if "daemon_peak_mb" in row:
        memory += f" + {row['daemon_peak_mb']:.0f}"
    return f"{time_cell(row)}; {memory} MB; {row['bytes'] / 1e6:.2f} MB"


def stages_cell(row):
    stages = ", ".join(f"{name} {number(ms)}" for name, ms in row["stages"].items())
    return f"{number(row['ms'])}: {stages}"


def dense_cell(row):
    store = f"; {number(row['store_ms'])}" if "store_ms" in row else ""
    return f"{time_cell(row)}{store}; {row['bytes'] / 1e6:.2f} MB"


def floor_cell(row):
    return (f"{number(row['ms'])}; {number(row['dense_ms'])} ({number(row['times_dense'])}); "
            f"{number(row['sparse_ms'])} ({number(row['times_sparse'])}); "
            f"{number(row['operations_ms'])}")


def codec_cell(row):
    return (f"{number(row['bits_per_voxel'])}; {number(row['encode_mb_s'])} / "
            f"{number(row['decode_mb_s'])}")


layout("voxelize", "Voxelize only", ("scene", "who"), "size", time_cell,
       "Milliseconds from the mesh in memory to its voxels, median; in brackets times voxeld's pipeline "
       "cpu, for rivals times the one measured beside them.")
layout("memory", "Voxelize only: peak memory", ("scene", "who"), "size",
       lambda row: f"{row['peak_mb']:.0f}", "Megabytes of the process at its peak, with the mesh and, except where rivals were "
       "measured, the libraries of images and drivers that the program loads.")
layout("attributes", "Attributes", ("scene", "who"), "size", time_cell,
       "Milliseconds of pipeline cpu from the mesh in memory to its voxels, without and with attributes: normals, "
       "or colour where the scene has a texture; in brackets times the occupancy alone.")
layout("solid", "Solid", ("scene", "who"), "size", time_cell,
       "As above, inside included: fill=solid, sign=parity; OpenVDB's signed distances and their "
       "interior mask; VTK's image stencil. Recast fills nothing.")
layout("stages", "Server-side stages", ("scene", "size"), "who", stages_cell,
       "Milliseconds at a client on the same machine: the stages of Server-Timing.")
layout("latency", "Latency", ("scene", "who"), "size", lambda row: number(row["ms"]),
       "Milliseconds at a client on one kept connection to a daemon on cpu: a mesh to its container, upload included; "
       "a picture of 512 x 512 of a stored grid.")
layout("dense", "Arrays and meshes", ("scene", "who"), "size", dense_cell,
       "Milliseconds of the stage encode on pipeline cpu, in brackets times npz; of the stage store; bytes "
       "of the file. Sparse: layout=sparse, a row for each voxel. Meshes: merged rectangles, or as named. "
       "Attributes are colour where the scene has a texture, else "
       "normals. Beside them numpy's own compression of the same array, once, and a plain write.")
layout("whole", "Whole process", ("scene", "who"), "size", whole_cell,
       "From a PLY file to a file on disk: milliseconds from start to end of the process, in brackets "
       "times voxel; peak memory (of voxel + its daemon and workers so far); bytes of the file. The "
       "rivals read by voxeld's reader; Recast writes plain bits, OpenVDB a .vdb.")
layout("sizes", "Bits per occupied voxel", ("scene", "channels", "who"), "size",
       lambda row: number(row["bits_per_voxel"]),
       "Whole files. NanoVDB, OpenVDB and binvox hold occupancy alone.")
layout("codecs", "Codecs of the container", ("scene", "who"), "size", codec_cell,
       "Bits per voxel; megabytes of plain stream encoded / decoded in a second by one core.")
layout("thesis", "The thesis's table", ("scene", "settings"), "who",
       lambda row: number(row["frames_per_s"]),
       "Frames per second: a frame is a mesh in memory made to voxels, at 256 (128 with --quick).")
layout("floors", "Floors of pipeline cpu", ("scene", "who"), "size", floor_cell,
       "Milliseconds: measured; floor of a dense grid (measured is so many times it); of sparse bricks "
       "(likewise); of operations. suite_parts/derived.py defines the floors.")


def skip_notes(rows):
    notes = {}
    for row in rows:
        if "skipped" in row:
            notes.setdefault(row["skipped"], len(notes) + 1)
    return notes


def pivot(rows, head, column, cell):
    """Markdown of a table with a column for each value of `column`."""
    notes = skip_notes(rows)
    columns = list(dict.fromkeys(row[column] for row in rows))
    lines = {}
    for row in rows:
        text = f"–{notes[row['skipped']]}" if "skipped" in row else cell(row)
        lines.setdefault(tuple(str(row[name]) for name in head), {})[row[column]] = text
    out = ["| " + " | ".join([*head, *map(str, columns)]) + " |",
           "|---" * (len(head) + len(columns)) + "|"]
    out += ["| " + " | ".join([*key, *(cells.get(c, "") for c in columns)]) + " |"
            for key, cells in lines.items()]
    return out + reasons(notes)


def reasons(notes):
    return [""] + [f"–{mark}: {reason.replace('|', '/')}  " for reason, mark in notes.items()] \
        if notes else []


def hashes(rows):
    """The first hashes in full, then a line for each variant."""
    shown = [dict(row, grid=f"{row['scene']}, {row['channels']}") for row in rows]
    first = {}
    for row in shown:
        if "hash" in row:
            first.setdefault(f"{row['grid']}, {row['size']}", row["hash"])
    out = [f"- {grid}: `{value}`" for grid, value in first.items()]
    return out + [""] + pivot(shown, ("who",), "grid",
                              lambda row: "equal" if row["equal"] else f"DIFFERS {row['hash']}")


def markdown(report):
    machine = report["machine"]
    out = ["# voxeld benchmark suite", "",
           ", ".join(f"{name} {value}" for name, value in machine.items()) + ".", "",
           "Scenes: " + "; ".join(f"{key}: {scene}" for key, scene in report["scenes"].items()) + ".",
           f"Medians of {report['runs']} runs after one that warms up."]
    for key, rows in report["tables"].items():
        if key == "hashes":
            out += ["", "## Content hashes", "", "Every grid by every pipeline, driver, instruction "
                    "set, number of threads and order of triangles.", "", *hashes(rows)]
            continue
        title, head, column, cell, note = LAYOUTS[key]
        out += ["", f"## {title}", "", note, "", *pivot(rows, head, column, cell)]
    return "\n".join(out) + "\n"


# Measurements of voxeld itself need neither rivals nor drivers: nothing excuses skipping them.
ALWAYS = {"voxelize": {"cpu", "cpu, beside the rivals"}, "stages": set(),
          "attributes": {"occupancy", "attributes"}, "latency": {latency.ONE_SHOT, *latency.SAMPLES.values()},
          "dense": {*dense.FORMATS, "write of the npy"}, "whole": {"voxel"},
          "sizes": {"native fast", "npz", ".vox", "binvox", "binvox + gzip"}, "floors": {"cpu"}}


def skipped_own(report):
    """Cells of ALWAYS that were skipped."""
    return [f"{key}: {row}" for key, who in ALWAYS.items() for row in report["tables"].get(key, [])
            if "skipped" in row and (row["who"] in who or not who)]


def holes(report):
    """Cells that have neither a number nor a reason, and tables without rows."""
    missing = []
    for key, rows in report["tables"].items():
        if not rows:
            missing.append(f"table {key} has no rows")
            continue
        if key == "hashes":
            missing += [f"hashes: {row}" for row in rows if not row.get("hash")
                        and not row.get("skipped")]
            continue
        _, head, column, cell, _ = LAYOUTS[key]
        there = {(*(row[name] for name in head), row[column]) for row in rows}
        for line in {key[:-1] for key in there}:
            missing += [f"{key}: {line} has no {value}" for value in
                        {row[column] for row in rows} if (*line, value) not in there]
        for row in rows:
            if not (row.get("skipped") or ("skipped" not in row and cell(row))):
                missing.append(f"{key}: {row}")
    return missing
