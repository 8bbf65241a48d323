#!/usr/bin/python3
"""Bundles a test of this folder with esbuild and runs it in Node.

    run_tests.py --esbuild PATH --node PATH --bin DIR --shaders DIR NAME

NAME_test.ts becomes an ES module in a temporary folder, beside the containers that
voxeld_web_containers makes and, for tests in a browser, the bundles of the page. The test reads
where things are from VIEW_TEST_DIR (that folder), VOXELD_BIN_DIR and VOXELD_SOURCE_DIR. Exit status
77, skipped, without esbuild, Node, or (for tests in a browser) Chromium.
"""
import argparse
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
IN_BROWSER = {"pictures", "controls", "memory"}
SKIPPED = 77


def bundle(arguments, source, output, *options):
    subprocess.run([arguments.esbuild, source, "--bundle", "--format=esm", "--loader:.glsl=text",
                    f"--alias:voxeld-shaders={arguments.shaders}",
                    "--log-level=warning", f"--outfile={output}", *options], check=True)


def bundle_page(arguments, folder):
    view = ROOT / "client/web/view"
    bundle(arguments, view / "decode_worker.ts", folder / "decode_worker.js", "--minify", "--target=es2022")
    bundle(arguments, view / "create_viewer.ts", folder / "create_viewer.js", "--minify", "--target=es2022")
    bundle(arguments, HERE / "browser/page.ts", folder / "page.js", "--target=es2022")
    shutil.copy(HERE / "browser/page.html", folder)


def skip_reason(arguments):
    for name, path in (("esbuild", arguments.esbuild), ("node", arguments.node)):
        if not path or not shutil.which(path):
            return f"{name} is not installed"
    if arguments.name in IN_BROWSER and not shutil.which("chromium"):
        return "chromium is not installed"
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option in ("esbuild", "node", "bin", "shaders"):
        parser.add_argument("--" + option, required=True)
    parser.add_argument("--keep", type=pathlib.Path, help="leave images and logs here")
    parser.add_argument("name")
    arguments = parser.parse_args()
    reason = skip_reason(arguments)
    if reason:
        print("skipped:", reason)
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="voxeld-view-") as name:
        folder = arguments.keep or pathlib.Path(name)
        folder.mkdir(exist_ok=True)
        subprocess.run([pathlib.Path(arguments.bin) / "voxeld_web_containers", folder / "containers"],
                       check=True)
        test = folder / f"{arguments.name}_test.mjs"
        bundle(arguments, HERE / f"{arguments.name}_test.ts", test, "--platform=node", "--target=node18")
        if arguments.name in IN_BROWSER:
            bundle_page(arguments, folder)
        environment = {**os.environ, "VIEW_TEST_DIR": str(folder), "VOXELD_BIN_DIR": arguments.bin,
                       "VOXELD_SOURCE_DIR": str(ROOT)}
        return subprocess.run([arguments.node, "--test", test], env=environment).returncode


if __name__ == "__main__":
    sys.exit(main())
