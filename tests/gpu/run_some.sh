#!/usr/bin/env bash
# Runs some tests of a program: run_some.sh PROGRAM PATTERN… (of gtest's filter). A pattern that
# names no test is an error: gtest would run fewer tests, or none, and pass.
set -euo pipefail
program=$1
shift
for pattern in "$@"; do
  names=$("$program" --gtest_list_tests "--gtest_filter=$pattern")
  [[ $names == *$'\n  '* ]] || { echo "error: $program has no test $pattern" >&2; exit 1; }
done
IFS=:
exec "$program" "--gtest_filter=$*"
