#!/usr/bin/python3
"""Finds using-declarations in source files whose name the rest of the file does not use.

clang-tidy's misc-unused-using-decls looks into the file alone that the compiler was started with;
tools/tidy checks units that include the sources. Headers are left out: they may declare names for
others.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
DECLARATION = re.compile(r"^ *using (?:::)?(?:\w+::)+(\w+); *$", re.MULTILINE)
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)


def unused(text):
    """The names in order."""
    code = COMMENT.sub("", text)
    rest = DECLARATION.sub("", code)
    return [name for name in DECLARATION.findall(code)
            if not re.search(rf"\b{re.escape(name)}\b", rest)]


def check_itself():
    """A check that finds nothing must be able to."""
    text = "using std::span;\nusing ::testing::HasSubstr;  // HasSubstr\nspan<int> s;\n"
    assert unused(text) == ["HasSubstr"], unused(text)


def main():
    check_itself()
    files = subprocess.run(["git", "ls-files", "*.cpp"], cwd=ROOT, check=True, capture_output=True,
                           text=True).stdout.split()
    found = [f"{file}: using {name}: not used in this file"
             for file in files for name in unused((ROOT / file).read_text())]
    print("\n".join(found) if found else f"{len(files)} files: every using-declaration is used")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
