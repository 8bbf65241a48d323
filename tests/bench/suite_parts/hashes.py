"""The same bits from every pipeline, driver, instruction set, triangle order and thread count."""
from .measures import ISAS

SHUFFLES = (1, 2)
THREADS = (1, 2, 3, 8)


def variants(drivers):
    """(what differs, pipeline, driver, flags); the first is what the others are compared with."""
    yield "cpu, widest instructions, all threads", "cpu", None, []
    for isa in ISAS:
        yield f"cpu, {isa}", "cpu", None, ["--isa", isa]
    for threads in THREADS:
        yield f"cpu, threads {threads}", "cpu", None, ["--threads", threads]
    for seed in SHUFFLES:
        yield f"cpu, triangles shuffled {seed}", "cpu", None, ["--shuffle", seed]
    yield "cpu, portable, 1 thread, shuffled", "cpu", None, [
        "--isa", "portable", "--threads", 1, "--shuffle", SHUFFLES[0]]
    for driver in drivers:
        for pipeline in ("compute", "raster"):
            yield f"{pipeline} on {driver}", pipeline, driver, []
            yield f"{pipeline} on {driver}, shuffled", pipeline, driver, ["--shuffle", SHUFFLES[0]]


def channels(scene):
    attributes = ["--channels", "occupancy,color,normal"] if scene.colored else [
        "--channels", "occupancy,normal"]
    return {"occupancy": [], "attributes": attributes}


def hash_table(context, scenes, size):
    """Rows with `hash` and whether it is the first's. Nothing is equal to nothing."""
    rows = []
    for scene in scenes:
        for name, options in channels(scene).items():
            expected = None
            for what, pipeline, driver, flags in variants(context.drivers):
                row = {"scene": scene.key, "size": size, "channels": name, "who": what}
                row |= _hash(context, scene, size, pipeline, driver, options + flags)
                if "hash" in row:
                    expected = expected or row["hash"]
                    row["equal"] = row["hash"] == expected
                rows.append(row)
    return rows


def _hash(context, scene, size, pipeline, driver, flags):
    if scene.skipped:
        return {"skipped": scene.skipped}
    if driver in context.dead_drivers:
        return {"skipped": context.dead_drivers[driver]}
    found, why = context.programs.json_rows(
        "voxelize_bench", scene.source, "--pipeline", pipeline, "--device", driver or "cpu",
        "--repeat", 1, "--hash", *flags, size)
    if not found:
        return {"skipped": why or "no result"}
    return {"hash": found[0]["hash"], "voxels": found[0]["voxels"]}


def all_equal(rows):
    """True where hashes were compared, more than one with itself, and none differs."""
    compared = [row for row in rows if "equal" in row]
    first = {(row["scene"], row["channels"]) for row in compared}
    return len(compared) > len(first) and all(row["equal"] for row in compared)
