#!/usr/bin/env python3
"""Writes a C++ source with the tables of text_encodings.cpp, from Python's codecs."""
import sys
import unicodedata

# In the order of kTextEncodings; those of two bytes first.
DOUBLE = ("gbk", "cp932", "cp950", "cp949")
CODECS = (*DOUBLE, "cp1252", "cp850", "cp437", "cp1250", "cp852", "cp1251", "cp866")


def character(codec, *encoded):
    """Its number; 0 for bytes that are none."""
    try:
        text = bytes(encoded).decode(codec)
    except UnicodeDecodeError:
        return 0
    is_character = len(text) == 1 and ord(text) < 0x10000 and unicodedata.category(text) not in ("Cc", "Co")
    return ord(text) if is_character else 0


def table(name, rows):
    lines = "\n".join("    {" + ",".join(map(str, row)) + "}," for row in rows)
    return f"const uint16_t {name}[][{len(rows[0])}] = {{\n{lines}\n}};\n"


def main(output):
    single = [[character(codec, first) for first in range(0x80, 0x100)] for codec in CODECS]
    double = [[character(codec, first, second) for first in range(0x81, 0xff) for second in range(0x40, 0xff)]
              for codec in DOUBLE]
    with open(output, "w", encoding="ascii") as file:
        file.write('#include "proto/file_names/encoding_tables.h"\n\nnamespace voxeld {\n\n'
                   + table("kSingleBytes", single) + "\n" + table("kDoubleBytes", double) + "\n}  // namespace voxeld\n")


if __name__ == "__main__":
    main(sys.argv[1])
