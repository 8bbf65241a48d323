"""openapi.yaml as client generators see it: redocly's lint, openapi-typescript, tsc --strict, and a program that runs a
job. The packages are those of package-lock.json; VOXELD_OPENAPI_DIR is the folder that uses them."""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/integration"))
import npm_packages  # noqa: E402
from harness import DaemonTest  # noqa: E402

SPEC = ROOT / "proto/openapi.yaml"
WORK = pathlib.Path(os.environ.get("VOXELD_OPENAPI_DIR", ROOT / "build/dev/openapi"))
SOURCES = ("lint.mjs", "redocly.yaml", "tsconfig.json", "run_job.ts", "typed_options.ts")


def run(*command, seconds=300):
    return subprocess.run(command, cwd=WORK, timeout=seconds,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def tool(name, *arguments):
    return run(WORK / "node_modules/.bin" / name, *arguments)


class Clients(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        npm_packages.prepare(HERE, WORK)
        for name in SOURCES:
            shutil.copyfile(HERE / name, WORK / name)
        super().setUpClass()

    def succeed(self, done):
        self.assertEqual(done.returncode, 0, done.stdout[-4000:] + done.stderr[-4000:])
        return done.stdout

    def test_redocly_finds_no_errors_or_warnings(self):
        self.assertEqual(self.succeed(run("node", "lint.mjs", str(SPEC))), "")
        (WORK / "wrong.yaml").write_text(SPEC.read_text().replace("operationId: ", "operation: "))
        self.assertIn("error struct: ", self.succeed(run("node", "lint.mjs", "wrong.yaml")))

    def test_a_typescript_program_runs_a_job(self):
        self.succeed(tool("openapi-typescript", str(SPEC), "-o", "api.d.ts"))
        shutil.rmtree(WORK / "js", ignore_errors=True)
        self.succeed(tool("tsc", "-p", "tsconfig.json"))
        out = self.succeed(run("node", "js/run_job.js", self.daemon.url, str(self.fixtures / "sample.ply")))
        told = json.loads(out)
        self.assertEqual(told["state"], "done")
        self.assertEqual((told["options"]["size"], told["options"]["fill"]), (32, "solid"))
        job = self.daemon.get("/v1/jobs?limit=1").json()["jobs"][0]
        self.assertEqual(told["bytes"], job["result"]["bytes"])


if __name__ == "__main__":
    unittest.main()
