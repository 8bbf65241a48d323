#!/usr/bin/env python3
"""Checks that #include directives obey the arrows of server/README.md, and other rules of style.

Each rule prints file:line and what is wrong; any finding makes the exit status 1.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def jobs(*folders, store=False):
    """Folders of server/jobs, with what all of them may include."""
    return ({"server/jobs/" + folder for folder in folders} | {"server/base", "proto"}
            | ({"server/store"} if store else set()))


def scene(*folders):
    """Folders of server/scene, with what all of them may include."""
    return {"server/scene/" + folder for folder in folders} | {"server/scene/core", "server/base",
                                                              "proto"}


def voxel(*folders, gpu=False):
    """Folders of server/voxel, with what all of them may include."""
    return ({"server/voxel/" + folder for folder in folders}
            | {"server/scene/core", "server/grid", "server/base", "proto", "shaders"}
            | ({"server/gpu", "server/device"} if gpu else set()))


VOXEL_INTERFACES = {"server/voxel" + folder for folder in (
    "", "/triangles", "/attributes", "/tiles", "/estimates", "/pipelines", "/frames")}


def worker(*folders, gl=False):
    """Folders of server/worker, with what all of them may include."""
    return ({"server/worker/" + folder for folder in folders}
            | {"server/scene", "server/scene/core", "server/render", "server/formats",
               "server/volumes",
               "server/grid", "server/device", "server/gpu", "server/process", "server/base",
               "proto"}
            | VOXEL_INTERFACES | ({"server/voxel/gl"} if gl else set()))


# module -> modules whose headers it may include.
ARROWS = {
    # Folders of the contract, from the lowest up. Others may include all of them.
    "proto": {"proto"},
    "proto/options": {"proto/options", "proto"},
    "proto/file_names": {"proto/file_names", "proto"},
    "proto/palette_files": {"proto/palette_files", "proto"},
    "proto/codec": {"proto/codec", "proto"},
    "proto/container": {"proto/container", "proto/codec", "proto/options", "proto"},
    "proto/messages": {"proto/messages", "proto/container", "proto/options", "proto"},
    "client": {"client", "proto"},
    "server/base": {"server/base", "proto"},
    "server/process": {"server/process", "server/base", "proto"},
    "server/grid": {"server/grid", "server/base", "proto"},
    # Folders of the scene: what loaders share, images, one for each format, the choice among them.
    "server/scene/core": {"server/scene/core", "server/base", "proto"},
    "server/scene/images": scene("images"),
    "server/scene/gltf": scene("gltf", "images"),
    "server/scene/md5": scene("md5", "images"),
    "server/scene/obj": scene("obj", "images"),
    "server/scene/off": scene("off"),
    "server/scene/ply": scene("ply", "images"),
    "server/scene/stl": scene("stl"),
    "server/scene/threemf": scene("threemf", "images"),
    "server/scene": scene("images", "gltf", "md5", "obj", "off", "ply", "stl", "threemf") | {"server/scene"},
    "server/store": {"server/store", "server/base", "proto"},
    "server/device": {"server/device", "server/process", "server/base", "proto"},
    "server/gpu": {"server/gpu", "server/device", "server/process", "server/base", "proto", "shaders"},
    "server/volumes": {"server/volumes", "server/grid", "server/base", "proto"},
    "server/formats": {"server/formats", "server/grid", "server/base", "proto"},
    # Folders of voxelization, from the lowest up.
    "server/voxel/triangles": voxel("triangles"),
    "server/voxel/attributes": voxel("attributes", "triangles"),
    "server/voxel/tiles": voxel("tiles"),
    "server/voxel/estimates": voxel("estimates", "attributes", "triangles"),
    "server/voxel/pipelines": voxel("pipelines", "estimates", "attributes", "triangles"),
    "server/voxel/frames": voxel("frames", "pipelines", "estimates", "attributes"),
    "server/voxel/cpu/kernels": {"server/voxel/cpu/kernels", "server/base", "proto"},
    "server/voxel/cpu": voxel("cpu", "cpu/kernels", "pipelines", "tiles", "attributes", "triangles"),
    "server/voxel/solid/inside": voxel("solid/inside", "triangles"),
    "server/voxel/solid/distance": voxel("solid/distance", "solid/inside"),
    "server/voxel/solid": voxel("solid", "solid/distance", "solid/inside", "pipelines"),
    "server/voxel/gl/occupancy": voxel("gl/occupancy", "pipelines", "estimates", "tiles",
                                       "triangles", gpu=True),
    "server/voxel/gl/skin": voxel("gl/skin", "pipelines", "triangles", gpu=True),
    "server/voxel/gl/solid": voxel("gl/solid", "solid", "solid/distance", "solid/inside",
                                   "estimates", "tiles", "triangles", gpu=True),
    "server/voxel/gl": voxel("gl", "gl/occupancy", "gl/skin", "gl/solid", "pipelines", "estimates",
                             "tiles", "attributes", "triangles", gpu=True),
    "server/voxel": voxel("cpu", "frames", "solid", "pipelines", "estimates", "tiles", "attributes",
                          "triangles") | {"server/voxel"},
    "server/render": {"server/render", "server/grid", "server/gpu", "server/base", "proto", "shaders"},
    # Folders of a worker process, from the lowest up.
    "server/worker/device": worker("device", gl=True),
    "server/worker/gateway": {"server/worker/gateway", "server/process", "server/base", "proto"},
    "server/worker/mesh": worker("mesh"),
    "server/worker/task": worker("task", "device", "gateway", "mesh"),
    "server/worker/grids": worker("grids", "mesh", "task"),
    "server/worker/frames": worker("frames", "grids", "task"),
    "server/worker/images": worker("images", "frames", "grids", "task"),
    "server/worker": worker("device", "frames", "gateway", "grids", "images", "mesh", "task")
                     | {"server/worker"},
    # Folders of jobs, from the lowest up.
    "server/jobs/model": jobs("model"),
    "server/jobs/database": jobs("database", store=True),
    "server/jobs/auth": jobs("auth", "database", "model"),
    "server/jobs/records": jobs("records", "database", "model", store=True),
    "server/jobs/events": jobs("events", "model"),
    "server/jobs/estimates": jobs("estimates", "model", store=True),
    "server/jobs/scheduling": jobs("scheduling", "model", "records", "events"),
    "server/jobs/retention": jobs("retention", "auth", "database", "events", "model", "records",
                                  store=True),
    "server/jobs/workers": jobs("workers", "events", "model", "records", "scheduling", store=True)
                           | {"server/process"},
    "server/jobs/service": jobs("service", "auth", "database", "estimates", "events", "model", "records",
                                "retention", "scheduling", "workers", store=True)
                           | {"server/process"},
    "server/http/message": {"server/http/message", "server/jobs/model", "server/store", "server/base",
                            "proto"},
    "server/http/sockets": {"server/http/sockets", "server/base", "proto"},
    "server/http": {"server/http", "server/http/message", "server/http/sockets", "server/jobs/model",
                    "server/store", "server/base", "proto"},
    "server/api": {"server/api", "server/http", "server/http/message", "server/http/sockets",
                   "server/process", "server/store"} | jobs("auth", "model", "service"),
    "server": {"server", "server/api", "server/http", "server/http/message", "server/process",
               "server/worker", "server/worker/device", "server/device", "server/store"}
              | jobs("auth", "database", "model", "retention", "service"),
    "shaders": {"shaders"},
}
# Headers that one module alone may include.
ONLY_IN = {
    "sqlite3.h": {"server/jobs/database"},
    # Others know the interface. Retention opens, checks and rebuilds the embedded store.
    "server/jobs/database/sqlite_connection.h": {"server/jobs/database", "server/jobs/retention"},
    "server/jobs/database/sqlite_database.h": {"server/jobs/database", "server/jobs/retention"},
    "server/jobs/database/sqlite_schema.h": {"server/jobs/database", "server/jobs/retention"},
    "curl/curl.h": {"client"},
    "httplib.h": {"server/api"},
    "zip.h": {"server/scene/core", "client"},
    "zstd.h": {"proto/codec", "server/formats", "server/http/message"},
    "gif_lib.h": {"server/scene/images", "server/render"},
    "png.h": {"server/scene/images", "server/render"},
    "jpeglib.h": {"server/scene/images"},
    "tiffio.h": {"server/scene/images"},
    "webp/decode.h": {"server/scene/images"},
    "stb/stb_image.h": {"server/scene/images"},
    "OpenImageIO/imageio.h": set(),  # only tests may
    "spdlog/spdlog.h": {"server/base"},
    "GL/glcorearb.h": {"server/gpu"},
}
LINE_MAX = 100
FILE_LINES_MAX = 600
FORBIDDEN = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b")
INCLUDE = re.compile(r'^\s*#include\s+(["<])([^">]+)[">]')


def module_of(path):
    parts = path.split("/")
    for depth in (4, 3, 2):
        if len(parts) > depth and "/".join(parts[:depth]) in ARROWS:
            return "/".join(parts[:depth])
    if parts[0] == "server" and len(parts) > 2:
        return "server/" + parts[1]
    return parts[0]


def check_file(path, findings):
    relative = path.relative_to(ROOT).as_posix()
    module = module_of(relative)
    lines = path.read_text(encoding="utf-8").splitlines()
    is_product = module in ARROWS
    if len(lines) > FILE_LINES_MAX and is_product:
        findings.append(f"{relative}: {len(lines)} lines, at most {FILE_LINES_MAX}")
    for number, line in enumerate(lines, 1):
        if len(line) > LINE_MAX and "http" not in line:
            findings.append(f"{relative}:{number}: {len(line)} columns, at most {LINE_MAX}")
        if FORBIDDEN.search(line):
            findings.append(f"{relative}:{number}: work left undone: {line.strip()}")
        match = INCLUDE.match(line)
        if not match or not is_product:
            continue
        target = match.group(2)
        if target in ONLY_IN and module not in ONLY_IN[target]:
            findings.append(f"{relative}:{number}: {target} belongs to {sorted(ONLY_IN[target])}")
        target_module = module_of(target)
        if match.group(1) == '"' and target_module in ARROWS:
            is_contract = target_module.startswith("proto/") and not module.startswith("proto")
            allowed = "proto" if is_contract else target_module
            if allowed not in ARROWS[module]:
                findings.append(f"{relative}:{number}: {module} must not include {target_module}")


def main():
    findings = []
    suffixes = {".h", ".cpp", ".glsl", ".comp", ".vert", ".geom", ".frag"}
    files = [path for top in ("proto", "client", "server", "shaders", "tests")
             for path in sorted((ROOT / top).rglob("*")) if path.suffix in suffixes]
    for path in files:
        check_file(path, findings)
    for finding in findings:
        print(finding)
    print(f"{len(files)} files, {len(findings)} findings")
    return 1 if findings or not files else 0


if __name__ == "__main__":
    sys.exit(main())
