#!/usr/bin/env python3
"""Turns an entry point and the files that it includes into a C++ struct, so that GL and the CPU
share one text of a pass.

    glsl_to_cpp.py ENTRY NAME OUTPUT

OUTPUT must be included inside a namespace that uses voxeld::glsl (shaders/glsl_float.h), once for
each set of macros that the entry point knows. struct NAME is then one invocation. Its first members
are the blocks and buffers in the order of the entry point, which callers initialize by name. Then
come gl_FragCoord, globals and outputs; main() runs the invocation.

The translator supports only what the entry points need: uniform blocks with one struct, readonly
buffers with one array, out variables, out and inout parameters, swizzles that are read, and
constructors of structs. Other GLSL that C++ spells differently does not compile, so nothing is
silently translated wrongly.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent
SKIPPED = {"shared/types.h"}  # GLSL's types for C++: here they are GLM's


def resolve(name, seen):
    """The text of a shader with its includes in place, each once, as GLSL sees it."""
    if name in seen or name in SKIPPED:
        return ""
    seen.add(name)
    out, conditions = [], []  # what C++ reads of headers is left out
    for line in (ROOT / name).read_text(encoding="utf-8").splitlines():
        word = line.strip()
        if word.startswith("#if"):
            conditions.append("C++" if word == "#ifdef __cplusplus" else "other")
        in_cpp = "C++" in conditions
        is_branch = word.startswith(("#if", "#else", "#endif")) and conditions[-1:] != ["other"]
        if word.startswith("#else") and conditions[-1] != "other":
            conditions[-1] = "GLSL" if conditions[-1] == "C++" else "C++"
        if word.startswith("#endif"):
            conditions.pop()
        if in_cpp or is_branch:
            continue
        include = re.match(r'#include "(?:shaders/)?([^"]+)"', word)
        out.append(resolve(include.group(1), seen) if include else line)
    return "\n".join(out)


def without_comments(text):
    return re.sub(r"/\*.*?\*/", " ", re.sub(r"//[^\n]*", "", text), flags=re.S)


def braced_constructors(text):
    """March(a, b) of a struct March -> March{a, b}."""
    for name in re.findall(r"\bstruct\s+(\w+)\s*\{", text):
        start = 0
        while True:
            found = re.compile(rf"\b{name}\(").search(text, start)
            if not found:
                break
            depth, end = 1, found.end()
            while depth > 0:
                depth += {"(": 1, ")": -1}.get(text[end], 0)
                end += 1
            text = (text[:found.end() - 1] + "{" + text[found.end():end - 1] + "}" + text[end:])
            start = found.end()
    return text


def swizzles(text):
    places = {c: i for set_ in ("xyzw", "rgba") for i, c in enumerate(set_)}

    def tag(match):
        return "->*Swizzle<" + ", ".join(str(places[c]) for c in match.group(1)) + ">{}"

    return re.sub(r"\.([xyzw]{2,4}|[rgba]{2,4})\b(?!\s*\()", tag, text)


def translate(text):
    text = re.sub(r"VOXELD_SHARED_(BEGIN|END)\b", "", text)
    text = text.replace("VOXELD_SHARED_CONST", "const")
    text = re.sub(r"layout\s*\([^)]*\)\s*uniform\s+\w+\s*\{\s*(\w+)\s+(\w+)\s*;\s*\}\s*;",
                  r"const \1& \2;", text)
    text = re.sub(
        r"layout\s*\([^)]*\)\s*readonly\s+buffer\s+\w+\s*\{\s*(\w+)\s+(\w+)\s*\[\]\s*;\s*\}\s*;",
        r"const \1* \2;", text)
    text = re.sub(r"layout\s*\([^)]*\)\s*out\s+(\w+)\s+(\w+)\s*;", r"\1 \2{};", text)
    text = re.sub(r"\b(?:inout|out)\s+(\w+)\s+(\w+)", r"\1& \2", text)
    text = re.sub(r"([(,]\s*)in\s+(\w+)\s+(\w+)", r"\1\2 \3", text)
    # Prototypes are removed, because members of a struct need none.
    text = re.sub(r"^\w+ \w+\([^()]*\);\n", "", text, flags=re.M)
    # Constants at file scope become static members. Those of functions are indented and stay.
    text = re.sub(r"^const\s+(\w+)\s+(\w+)\s*=", r"static inline const \1 \2 =", text, flags=re.M)
    text = re.sub(r"(?<![\w.])(\d+\.\d*(?:[eE][-+]?\d+)?|\d+[eE][-+]?\d+|\.\d+)(?![\w.])", r"\1f",
                  text)
    return swizzles(braced_constructors(text))


def struct_text(entry, name):
    text = translate(without_comments(resolve(entry, set())))
    # Bindings come first, so that they can be given by name and the rest keep their defaults.
    binding = re.compile(r"^const \w+[&*] ?\w+;\n?", flags=re.M)
    structs = re.compile(r"^struct \w+ \{.*?^\};\n?", flags=re.M | re.S)
    defines = re.compile(r"^#define .*\n?", flags=re.M)
    head = "".join(defines.findall(text)) + "".join(structs.findall(text))
    rest = structs.sub("", defines.sub("", text))
    return (f"// Made by glsl_to_cpp.py from {entry}.\n{head}\nstruct {name} {{\n"
            + "".join(f"  {line.strip()}\n" for line in binding.findall(rest))
            + "\n  vec4 gl_FragCoord{};\n" + binding.sub("", rest) + "\n};\n")


def main():
    entry, name, output = sys.argv[1:]
    pathlib.Path(output).write_text(struct_text(entry, name), encoding="utf-8")


if __name__ == "__main__":
    main()
