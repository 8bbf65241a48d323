"""Levels of detail and regions over HTTP, against numpy."""
import io
import json
import unittest

import numpy as np

from harness import DaemonTest
from test_render import decode_png


def linear16(srgb):
    c = srgb / 255.0
    return np.floor(65535 * np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) + 0.5)


def srgb8(linear):
    c = linear / 65535.0
    return np.floor(255 * np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055) + 0.5)


def cubes(array, side):
    """The cells of each cube of a dense z,y,x array along a last axis, padded with zeros."""
    pad = [(0, -n % side) for n in array.shape[:3]] + [(0, 0)] * (array.ndim - 3)
    array = np.pad(array, pad)
    z, y, x = (n // side for n in array.shape[:3])
    rest = array.shape[3:]
    array = array.reshape(z, side, y, side, x, side, *rest)
    order = (0, 2, 4, 1, 3, 5) + tuple(range(6, 6 + len(rest)))
    return array.transpose(order).reshape(z, y, x, side ** 3, *rest)


class Levels(DaemonTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        response = cls.daemon.post("/v1/voxelize?size=300&fill=solid&sign=flood&format=npz"
                                   "&filename=sample.glb&channels=occupancy,color,normal",
                                   cls.fixture(cls, "sample.glb"))
        assert response.status == 200, response.body
        cls.grid = response.headers["X-Voxeld-Grid"]
        cls.whole = np.load(io.BytesIO(response.body))

    def npz(self, query):
        response = self.daemon.get(f"/v1/grids/{self.grid}?format=npz&{query}")
        self.assertEqual(response.status, 200, response.body)
        return np.load(io.BytesIO(response.body)), json.loads(response.headers["X-Voxeld-Meta"])

    def test_levels_equal_those_of_numpy(self):
        for level in (1, 2, 3, 5):
            count = cubes(self.whole["occupancy"], 2 ** level).sum(axis=-1, dtype=int)
            for rule, least in (("any", 1), ("majority", 8 ** level // 2)):
                got, meta = self.npz(f"level={level}&level_rule={rule}")
                self.assertTrue((got["occupancy"] == (count >= least)).all(), (level, rule))
                self.assertEqual((meta["level"], meta["level_rule"]), (level, rule))
                self.assertEqual(meta["voxel_count"], int((count >= least).sum()))
                np.testing.assert_array_equal(got["origin"], self.whole["origin"])
                np.testing.assert_array_equal(got["voxel_size"],
                                              self.whole["voxel_size"] * 2 ** level)

    def test_colours_are_means_in_linear_light(self):
        got, _ = self.npz("level=2")
        color = cubes(self.whole["color"], 4).astype(float)
        colored = (color != 0).any(axis=-1)
        n = np.maximum(colored.sum(axis=-1), 1)
        for channel in range(3):
            total = (linear16(color[..., channel]) * colored).sum(axis=-1)
            expected = srgb8(np.floor((total + n // 2) / n))
            expected[~colored.any(axis=-1)] = 0
            self.assertLessEqual(np.abs(got["color"][..., channel] - expected).max(), 0, channel)

    def test_a_region_is_the_cells_of_its_box(self):
        got, meta = self.npz("region=11,20,30,150,100,90")
        self.assertEqual(meta["region"], [11, 20, 30, 150, 100, 90])
        for member in ("occupancy", "color", "normal"):
            np.testing.assert_array_equal(got[member], self.whole[member][30:90, 20:100, 11:150])
        np.testing.assert_allclose(
            got["origin"], self.whole["origin"] + self.whole["voxel_size"] * [11, 20, 30])

    def test_a_region_of_a_level_is_a_part_of_that_level(self):
        level, _ = self.npz("level=3")
        part, _ = self.npz("level=3&region=11,20,30,150,100,90")
        np.testing.assert_array_equal(part["occupancy"], level["occupancy"][3:12, 2:13, 1:19])
        np.testing.assert_array_equal(part["color"], level["color"][3:12, 2:13, 1:19])

    def test_a_level_has_an_id_tiles_and_images_of_its_own(self):
        first = self.daemon.get(f"/v1/grids/{self.grid}?level=1")
        self.assertEqual(first.status, 200)
        level = first.headers["X-Voxeld-Grid"]
        self.assertNotEqual(level, self.grid)
        self.assertEqual(self.daemon.get(f"/v1/grids/{level}").body, first.body)
        directory = self.daemon.get(f"/v1/grids/{self.grid}/tiles?level=1").json()
        self.assertEqual(directory, self.daemon.get(f"/v1/grids/{level}/tiles").json())
        self.assertEqual(directory["grid"], level)
        tile = directory["tiles"][0]
        bytes_of_tile = self.daemon.get(f"/v1/grids/{self.grid}/tiles/0?level=1").body
        self.assertEqual(bytes_of_tile, first.body[tile["offset"]:tile["offset"] + tile["bytes"]])
        again = self.daemon.get(f"/v1/grids/{self.grid}?level=1")
        self.assertIn("hit", again.headers["Cache-Status"])

    def test_images_take_level_and_region(self):
        def image(query):
            response = self.daemon.get(f"/v1/grids/{self.grid}/render.png?width=96&height=96"
                                       f"&background=transparent&{query}")
            self.assertEqual(response.status, 200, response.body)
            return (decode_png(response.body)[..., 3] > 0,
                    json.loads(response.headers["X-Voxeld-Meta"])["drawn"])

        whole, drawn = image("azimuth=10")
        self.assertEqual(drawn["level"], 0)
        coarse, drawn = image("azimuth=10&level=3")
        self.assertEqual(drawn["level"], 3)
        self.assertLess(coarse.sum(), 2 * whole.sum())
        self.assertGreater((coarse & whole).sum(), 0.95 * whole.sum())
        _, drawn = image("region=0,0,0,100,100,100")
        self.assertEqual(drawn["level"], 0)
        self.assertLess(drawn["voxels"], int(self.whole["occupancy"].sum()))

    def test_invalid_levels_and_regions_are_refused(self):
        for query, words in (("level=15", "an integer from 0 to 14"),
                             ("level_rule=most", "any | majority"),
                             ("region=0,0,0,1", "each minimum below its maximum"),
                             ("region=0,0,0,301,1,1", "in the grid's cells")):
            response = self.daemon.get(f"/v1/grids/{self.grid}?{query}")
            self.assert_problem(response, 400, "invalid-option", words)
        response = self.daemon.get(f"/v1/grids/{self.grid}/tiles?format=npy")
        self.assert_problem(response, 400, "unknown-option",
                            "option 'format' does not apply to this request")


if __name__ == "__main__":
    unittest.main()
