#!/usr/bin/env python3
"""Writes proto/openapi.yaml as JSON in a C++ source: openapi_json.py IN.yaml OUT.cpp"""
import json
import sys

import yaml

with open(sys.argv[1], encoding="utf-8") as file:
    text = json.dumps(yaml.safe_load(file), separators=(",", ":"))
# Compilers need not take a literal of more than 65,536 characters, neighbours counted together.
parts = [text[i:i + 8000] for i in range(0, len(text), 8000)]
with open(sys.argv[2], "w", encoding="utf-8") as file:
    file.write('#include "server/api/openapi_json.h"\n\n#include <string>\n\nnamespace voxeld::api {\n'
               "std::string_view openapi_json() {\n  static const std::string text = [] {\n"
               f"    std::string joined;\n    joined.reserve({len(text)});\n")
    file.write("".join(f'    joined += R"json({part})json";\n' for part in parts))
    file.write("    return joined;\n  }();\n  return text;\n}\n}  // namespace voxeld::api\n")
