#!/usr/bin/env python3
"""Bundles the web page, and embeds it in a C++ source.

  build_page.py --page DIR                                  files to serve with `voxeld serve --web-dir DIR`
  build_page.py --page DIR --source OUT.cpp --depfile OUT.d    the same, and what server/api/web_files.h declares

Scripts and styles have the SHA-256 of their bytes in their name, so that browsers may keep them for ever. Compressed
files have no time stamp: equal sources give equal bytes.
"""
import argparse
import hashlib
import json
import pathlib
import re
import subprocess
import sys
import tempfile

from minify_glsl import minified

HERE = pathlib.Path(__file__).resolve().parent
SHADERS = HERE.parents[1] / "shaders"
# Entry points: name of the output, source.
ENTRIES = {"app.js": "app/main.ts", "worker.js": "view/decode_worker.ts", "app.css": "app/style.css"}
MEDIA_TYPES = {".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8",
               ".css": "text/css; charset=utf-8"}
UNIFORM = re.compile(r"\buniform\s+(?:highp\s+\w+\s+)?(\w+)")  # a texture or a block
HASH_DIGITS = 16
EARLIER = re.compile(r"(?:app|worker)\.[0-9a-f]{%d}\.(?:js|css)" % HASH_DIGITS)  # files of another build
# Macros of the CPU renderer and of tests; no variant of the page defines them.
NEVER_DEFINED = ("RAYMARCH_LANES", "RAYMARCH_HITS")


def bundle(esbuild, entry, out, shaders):
    """Bundles one entry point into `out`; returns the sources that went into it."""
    with tempfile.TemporaryDirectory() as scratch:
        meta = pathlib.Path(scratch) / "meta.json"
        subprocess.run([esbuild, str(HERE / entry), "--bundle", "--minify", "--format=esm", "--target=es2022",
                        "--loader:.glsl=text", f"--alias:voxeld-shaders={shaders}", "--legal-comments=inline",
                        "--log-level=warning", f"--outfile={out}", f"--metafile={meta}"], check=True, cwd=HERE)
        return [(HERE / name).resolve() for name in json.loads(meta.read_text())["inputs"]]


def make_shader(folder):
    """Writes the viewer's shader into the folder; returns the sources that it depends on."""
    path = folder / "raymarch.es.glsl"
    subprocess.run([sys.executable, "-B", str(SHADERS / "glsl_to_es.py"), str(path)], check=True)
    text = path.read_text(encoding="utf-8")
    path.write_text(minified(text, set(UNIFORM.findall(text)), NEVER_DEFINED), encoding="utf-8")
    kinds = ("raymarch.frag", "raymarch/*.glsl", "shared/*.h", "glsl_to_*.py")
    return sorted(path for kind in kinds for path in SHADERS.glob(kind))


def hashed(name, data):
    stem, dot, extension = name.rpartition(".")
    return f"{stem}.{hashlib.sha256(data).hexdigest()[:HASH_DIGITS]}{dot}{extension}"


def build(esbuild):
    """The files of the page, name -> bytes, and the sources that they depend on."""
    sources, files, names = [HERE / "app/index.html"], {}, {}
    with tempfile.TemporaryDirectory() as scratch:
        shader = make_shader(pathlib.Path(scratch))
        for name, entry in ENTRIES.items():
            out = pathlib.Path(scratch) / name
            sources += [path for path in bundle(esbuild, entry, out, scratch) if HERE in path.parents]
            data = out.read_bytes()
            names[name] = hashed(name, data)
            files[names[name]] = data
    document = (HERE / "app/index.html").read_text(encoding="utf-8")
    for name, with_hash in names.items():
        if f"/web/{name}" not in document:
            raise SystemExit(f"app/index.html does not name /web/{name}")
        document = document.replace(f"/web/{name}", f"/web/{with_hash}")
    files["index.html"] = re.sub(r">\s+<", "><", document).encode()
    return dict(sorted(files.items())), sources + shader


def compressed(gzip, data):
    """The bytes in gzip. 12 is the highest level of libdeflate, about 2.5% better than zlib's."""
    return subprocess.run([gzip, "-12", "-c"], input=data, stdout=subprocess.PIPE, check=True).stdout


def write_source(path, packed, files):
    """A C++ source with the files of `packed` (name -> gzipped bytes)."""
    text = ['// Made by client/web/build_page.py.\n#include "server/api/web_files.h"\n\n#include <array>\n\n'
            "namespace voxeld::api {\nnamespace {\n"]
    rows = []
    for i, (name, data) in enumerate(packed.items()):
        lines = [", ".join(map(str, data[at:at + 24])) for at in range(0, len(data), 24)]
        text.append(f"constexpr std::array<unsigned char, {len(data)}> kFile{i} = {{\n    "
                    + ",\n    ".join(lines) + "};\n")
        rows.append(f'    WebFile{{"{name}", "{MEDIA_TYPES[pathlib.Path(name).suffix]}",\n'
                    f'            "{hashlib.sha256(files[name]).hexdigest()}", kFile{i}, {len(files[name])}}},\n')
    text.append(f"constexpr std::array<WebFile, {len(rows)}> kFiles = {{\n" + "".join(rows) + "};\n"
                "}  // namespace\n\nstd::span<const WebFile> web_files() {\n  return kFiles;\n}\n\n"
                "}  // namespace voxeld::api\n")
    path.write_text("".join(text), encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--esbuild", default="esbuild")
    parser.add_argument("--gzip", default="libdeflate-gzip")
    parser.add_argument("--page", type=pathlib.Path, required=True)
    parser.add_argument("--source", type=pathlib.Path)
    parser.add_argument("--depfile", type=pathlib.Path)
    arguments = parser.parse_args()
    files, sources = build(arguments.esbuild)
    arguments.page.mkdir(parents=True, exist_ok=True)
    for path in arguments.page.iterdir():
        if EARLIER.fullmatch(path.name) and path.name not in files:
            path.unlink()
    for name, data in files.items():
        (arguments.page / name).write_bytes(data)
    packed = {name: compressed(arguments.gzip, data) for name, data in files.items()}
    total = sum(map(len, packed.values()))
    print("page:", ", ".join(f"{name} {len(data)}" for name, data in packed.items()), f"= {total} bytes gzipped")
    if arguments.source:
        write_source(arguments.source, packed, files)
    if arguments.depfile:
        escaped = " ".join(str(path).replace(" ", "\\ ") for path in sorted(set(sources)))
        arguments.depfile.write_text(f"{arguments.source}: {escaped}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
