"""Tables derived from the times: the thesis's table, and the distance to floors.

Bytes that no voxelizer can do without, on the memory bandwidth measured in the same run:
- dense: triangles read once as nine floats (36 B), one bit per cell cleared and written;
- sparse: triangles read once from an indexed mesh (three indices and half a vertex: 18 B), the
  64 B masks of occupied bricks cleared and written, one bit per brick of the grid.
Operations: Schwarz & Seidel's (2010) set-up of a triangle (normal, plane, three edges in three
projections: 60 multiplications and additions) and one operation for every occupied voxel, on the rate
of vectorized 32-bit multiply-adds measured in the same run. The floor is the larger of bytes and
operations.
"""
from . import measures

TRIANGLE_BYTES_SOUP = 36
TRIANGLE_BYTES_INDEXED = 18
BRICK_BYTES = 64
BRICK_SIDE = 8
TRIANGLE_OPERATIONS = 60

THESIS_SIZE = 256
# As this product's default, and as the thesis: its definition of a voxel, colours by its shading.
THESIS_SETTINGS = {"touch, occupancy": [],
                   "center, shaded": ["--rule", "center", "--color", "shaded"]}


def floors_table(rows, machine):
    """Beside every time of pipeline cpu in `rows`, those of the table voxelize."""
    return [_floor(row, machine) for row in rows if row["who"] == "cpu"]


def _floor(row, machine):
    cells = {"scene": row["scene"], "size": row["size"], "who": "cpu"}
    if "skipped" in row:
        return cells | {"skipped": row["skipped"]}
    if "skipped" in machine:
        return cells | {"skipped": machine["skipped"]}
    triangles = row["triangles"]
    read, clear = machine["read_gb_s"] * 1e6, machine["clear_gb_s"] * 1e6  # bytes per millisecond
    dense = triangles * TRIANGLE_BYTES_SOUP / read + 2 * row["cells"] / 8 / clear
    directory = row["cells"] / BRICK_SIDE**3 / 8
    sparse = (triangles * TRIANGLE_BYTES_INDEXED / read
              + (2 * row["bricks"] * BRICK_BYTES + directory) / clear)
    work = (triangles * TRIANGLE_OPERATIONS + row["voxels"]) / (machine["integer_gops"] * 1e6)
    return cells | {"ms": row["ms"], "dense_ms": dense, "sparse_ms": sparse, "operations_ms": work,
                    "times_dense": row["ms"] / max(dense, work),
                    "times_sparse": row["ms"] / max(sparse, work)}


def thesis_table(context, scenes, size=THESIS_SIZE):
    """Frames per second: a frame is a mesh in memory made to voxels."""
    rows = []
    for scene in scenes:
        for settings, options in THESIS_SETTINGS.items():
            for pipeline in ("cpu", "compute", "raster"):
                driver = None if pipeline == "cpu" else context.first_driver
                row, = measures.voxelize(context, scene, [size], pipeline, driver, options)
                row["settings"] = settings
                if "ms" in row:
                    row["frames_per_s"] = 1000 / row["ms"]
                rows.append(row)
    return rows
