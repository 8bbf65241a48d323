"""KTX 2.0 textures by ktx-parse and three.js, compared with the npz of the same grid. The packages are those of
package-lock.json; VOXELD_TEXTURES_DIR is the folder that uses them."""
import io
import json
import os
import pathlib
import sys
import unittest

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/integration"))
import npm_packages  # noqa: E402
from harness import DaemonTest  # noqa: E402

WORK = pathlib.Path(os.environ.get("VOXELD_TEXTURES_DIR", ROOT / "build/dev/textures"))
ZSTANDARD = 2
# The VkFormat and the bits of a texel of each channel.
FORMATS = {"occupancy": (9, 8), "color": (43, 32), "normal": (38, 32), "material": (74, 16), "label": (74, 16),
           "distance": (100, 32), "coverage": (9, 8)}
READ_BY_THREE = {"occupancy", "color", "distance", "coverage"}


class Textures(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        cls.reader = npm_packages.Program(HERE, WORK, "read_ktx2.mjs")
        cls.addClassCleanup(cls.reader.end)
        super().setUpClass()

    def voxelize(self, query):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename=sample.obj.zip", self.fixture("sample.obj.zip"))
        self.assertEqual(response.status, 200, response.body)
        return response.body

    def read(self, query):
        (WORK / "grid.ktx2").write_bytes(self.voxelize(query + "&format=ktx2"))
        return self.reader("grid.ktx2", "texels")

    def check(self, query, name, grid):
        read = self.read(f"{query}&units=mm&channel={name}")
        parsed = read["ktx_parse"]
        size = list(grid["occupancy"].shape[::-1])
        vk_format, bits = FORMATS[name]
        self.assertEqual((parsed["vkFormat"], parsed["scheme"], parsed["size"]), (vk_format, ZSTANDARD, size))
        self.assertEqual((parsed["layerCount"], parsed["faceCount"], len(parsed["levels"])), (0, 1, 1))
        self.assertEqual(parsed["levels"][0][1], grid["occupancy"].size * bits // 8)
        block, = parsed["descriptor"]
        self.assertEqual(sum(sample["bitLength"] + 1 for sample in block["samples"]), bits)
        self.assertEqual(block["bytesPlane"][0], bits // 8)
        values = parsed["values"]
        self.assertEqual((values["KTXorientation"], values["KTXwriter"]), ("ruo", "voxeld"))
        self.assertEqual((values["voxeld.channel"], values["voxeld.units"]), (name, "mm"))
        for key in ("origin", "voxel_size"):
            got = [float(word) for word in values["voxeld." + key].split()]
            np.testing.assert_allclose(got, grid[key], rtol=1e-12, atol=1e-12)
        self.assertEqual(json.loads(values["voxeld.meta"])["units"], "mm")
        self.check_three(read["three"], name, grid, size)

    def check_three(self, read, name, grid, size):
        if name not in READ_BY_THREE:
            self.assertIn("Unsupported vkFormat", read["refused"])
            return
        self.assertEqual((read.get("is_3d"), read.get("size")), (True, size), read)
        self.assertEqual(read["color_space"], "srgb" if name == "color" else "srgb-linear")
        wanted = grid[name]
        if name == "occupancy":
            wanted = wanted * np.uint8(255)
        if name == "distance":
            wanted = (wanted.astype(float) * grid["voxel_size"][0]).astype(np.float32)
        self.assertEqual((WORK / "texels").read_bytes(), wanted.tobytes())

    def test_textures_have_the_array_of_the_npz(self):
        for query, names in (("size=61&channels=color,normal,label&labels=material",
                              ("occupancy", "color", "normal", "label")),
                             ("size=48&fill=solid&channels=material,coverage", ("material", "coverage")),
                             ("size=40&fill=band", ("distance",))):
            for place in ("", "&level=1", "&region=10,5,3,36,17,18"):
                grid = np.load(io.BytesIO(self.voxelize(query + place + "&units=mm&format=npz")))
                for name in names:
                    with self.subTest(name=name, place=place):
                        self.check(query + place, name, grid)


if __name__ == "__main__":
    unittest.main()
