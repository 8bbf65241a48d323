#!/usr/bin/env python3
"""Turns the ray march pass into the GLSL ES 3.00 text that the page's viewer compiles in WebGL2.

    glsl_to_es.py OUTPUT [--validate VALIDATOR]

OUTPUT is the text of raymarch.frag with its includes, without comments and needless spaces and
without what only the daemon compiles (RAYMARCH_LANES, RAYMARCH_HITS), below a head of what ES lacks: doubles (single precision serves grids of the page's size), integer mix() and bitCount().
Storage buffers become textures of unsigned integers of 4096 columns. A line VARIANT after #version
is where the viewer writes the macros of a variant. --validate has glslangValidator check every
variant of raymarch.frag in variants.txt, so that a change which ES refuses fails here.
"""
import argparse
import itertools
import pathlib
import re
import subprocess
import sys
import tempfile

from glsl_to_cpp import ROOT, resolve, without_comments

ENTRY = "raymarch.frag"
VARIANT = "VARIANT"
COLUMNS = "4095u), int(index >> 12)"  # TABLE_COLUMNS of client/web/view/pack/packed_grid.ts
HEAD = """#version 300 es
VARIANT
precision highp float;
precision highp int;
#define double float
#define dvec2 vec2
#define dvec3 vec3
#define dvec4 vec4
int bitCount(uint v) {
  v -= (v >> 1) & 0x55555555u;
  v = (v & 0x33333333u) + ((v >> 2) & 0x33333333u);
  return int(((v + (v >> 4)) & 0x0f0f0f0fu) * 0x01010101u >> 24);
}
ivec3 bitCount(uvec3 v) { return ivec3(bitCount(v.x), bitCount(v.y), bitCount(v.z)); }
ivec3 es_mix(ivec3 a, ivec3 b, bvec3 c) {
  return ivec3(c.x ? b.x : a.x, c.y ? b.y : a.y, c.z ? b.z : a.z);
}
vec3 es_mix(vec3 a, vec3 b, bvec3 c) { return mix(a, b, c); }
vec4 es_mix(vec4 a, vec4 b, bvec4 c) { return mix(a, b, c); }
float es_mix(float a, float b, float c) { return mix(a, b, c); }
vec3 es_mix(vec3 a, vec3 b, float c) { return mix(a, b, c); }
vec4 es_mix(vec4 a, vec4 b, float c) { return mix(a, b, c); }
#define mix es_mix
"""


def without_branches_of(macros, text):
    """Drops what #ifdef of the macros encloses. Their #else branches stay."""
    kept, conditions = [], []  # of each open condition: whether it is one of the macros', and open
    for line in text.splitlines():
        word = line.split()[:2]
        if word and word[0] in ("#if", "#ifdef", "#ifndef"):
            conditions.append("dropped" if word[0] == "#ifdef" and word[1] in macros else "other")
            is_own = conditions[-1] == "dropped"
        elif word and word[0] in ("#else", "#endif"):
            is_own = conditions[-1] != "other"
            if word[0] == "#endif":
                conditions.pop()
            elif is_own:
                conditions[-1] = "kept"
        else:
            is_own = False
        if not is_own and "dropped" not in conditions:
            kept.append(line)
    return "\n".join(kept)


def without_spaces(text):
    """Joins the lines between directives and drops spaces that separate no words."""
    parts = []
    for is_directive, lines in itertools.groupby(text.splitlines(), lambda line: line.startswith("#")):
        if is_directive:
            parts.extend(lines)
        else:
            words = " ".join(" ".join(lines).split())
            parts.append(re.sub(r" ?([^\w\s+\-]) ?", r"\1", words))
    return "\n".join(part for part in parts if part)


def es_text():
    text = without_comments(resolve(ENTRY, set()))
    text = without_branches_of({"RAYMARCH_LANES", "RAYMARCH_HITS"}, text)
    text = re.sub(r"VOXELD_SHARED_(BEGIN|END)\b", "", text)
    text = re.sub(r"layout\s*\(std140,\s*binding\s*=\s*\w+\)", "layout(std140)", text)
    text, buffers = re.subn(
        r"layout\s*\([^)]*\)\s*readonly\s+buffer\s+\w+\s*\{\s*uint\s+(\w+)\[\];\s*\}\s*;",
        r"uniform highp usampler2D \1;", text)
    text, reads = re.subn(r"return (\w+)\[index\];",
                          rf"return texelFetch(\1, ivec2(int(index & {COLUMNS}), 0).r;", text)
    if buffers != reads or buffers == 0:
        sys.exit(f"glsl_to_es.py: {ENTRY} has {buffers} buffers, and {reads} functions that read one")
    text = "\n".join(line.strip() for line in text.splitlines())
    return HEAD.strip() + "\n" + without_spaces(text) + "\n"


def variants():
    """The macros of each variant of the entry point in variants.txt."""
    for line in (ROOT / "variants.txt").read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words and words[0] == ENTRY and "RAYMARCH_HITS=1" not in words:
            yield words[1:]


def validate(text, validator):
    checked = 0
    for macros in variants():
        defines = "\n".join("#define " + macro.replace("=", " ") for macro in macros)
        with tempfile.NamedTemporaryFile("w", suffix=".frag") as file:
            file.write(text.replace(VARIANT, defines, 1))
            file.flush()
            run = subprocess.run([validator, file.name], capture_output=True, text=True)
        if run.returncode != 0:
            sys.exit(f"{ENTRY} as GLSL ES 3.00 with {' '.join(macros)}:\n{run.stdout}{run.stderr}")
        checked += 1
    if checked == 0:
        sys.exit(f"glsl_to_es.py: variants.txt has no variant of {ENTRY}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--validate", metavar="VALIDATOR")
    arguments = parser.parse_args()
    text = es_text()
    if arguments.validate:
        validate(text, arguments.validate)
    arguments.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
