#!/usr/bin/env python3
"""Writes proto/openapi.yaml as JSON in a C++ source: openapi_json.py IN.yaml OUT.cpp"""
import json
import sys

import yaml

with open(sys.argv[1], encoding="utf-8") as file:
    text = json.dumps(yaml.safe_load(file), separators=(",", ":"))
# Compilers limit the length of one literal; neighbours are joined.
parts = [text[i:i + 8000] for i in range(0, len(text), 8000)]
with open(sys.argv[2], "w", encoding="utf-8") as file:
    file.write('#include "server/http/openapi_json.h"\n\nnamespace voxeld::http {\n'
               "std::string_view openapi_json() {\n  static constexpr char kText[] =\n")
    file.write("\n".join(f'      R"json({part})json"' for part in parts))
    file.write(";\n  return {kText, sizeof kText - 1};\n}\n}  // namespace voxeld::http\n")
