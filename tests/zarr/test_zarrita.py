"""Live Zarr stores of both versions as zarrita reads them over HTTP, against the npz of the same grid. The packages are
those of package-lock.json; VOXELD_ZARR_DIR is the folder that uses them."""
import io
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/integration"))
import npm_packages  # noqa: E402
from harness import DaemonTest  # noqa: E402

WORK = pathlib.Path(os.environ.get("VOXELD_ZARR_DIR", ROOT / "build/dev/zarr"))
LEVELS = 3
PATHS = {"occupancy": "", "color": "color/", "normal": "normal/", "label": "labels/label/"}


class Zarrita(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        npm_packages.prepare(HERE, WORK)
        shutil.copyfile(HERE / "read_store.mjs", WORK / "read_store.mjs")
        super().setUpClass()
        name = "sample.obj.zip"
        query = f"size=150&channels=color,normal,label&labels=material&format=npz&filename={name}"
        response = cls.daemon.post(f"/v1/voxelize?{query}", (cls.fixtures / name).read_bytes())
        assert response.status == 200, response.body
        cls.grid = cls.daemon.get("/v1/grids").json()["grids"][0]["id"]

    def read(self, store, version, paths):
        url = f"{self.daemon.url}/v1/grids/{self.grid}/{store}"
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(["node", "read_store.mjs", url, version, folder, *paths], cwd=WORK, timeout=300,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            self.assertEqual(done.returncode, 0, done.stderr[-4000:])
            facts = json.loads(done.stdout)
            arrays = [np.frombuffer((pathlib.Path(folder) / f"{i}.bin").read_bytes(),
                                    np.dtype(array["type"])).reshape(array["shape"])
                      for i, array in enumerate(facts["arrays"])]
        return arrays, facts["attributes"]

    def test_levels_of_both_versions_equal_npz(self):
        for store, version in (("zarr", "3"), ("zarr2", "2")):
            paths = [f"{group}{level}" for level in range(LEVELS) for group in PATHS.values()]
            arrays, attributes = self.read(store, version, paths)
            at = iter(arrays)
            for level in range(LEVELS):
                response = self.daemon.get(f"/v1/grids/{self.grid}?format=npz&axes=zyx&level={level}")
                expected = np.load(io.BytesIO(response.body))
                for name in PATHS:
                    np.testing.assert_array_equal(next(at), expected[name], f"{name} {level}, version {version}")
            scales = (attributes.get("ome") or attributes)["multiscales"][0]["datasets"]
            self.assertEqual([scale["path"] for scale in scales][:LEVELS], [str(level) for level in range(LEVELS)])


if __name__ == "__main__":
    unittest.main()
