"""Components, dilation, erosion, shells and remapped labels of grids and sequences, compared with scipy.ndimage."""
import io
import json

import numpy as np
from scipy import ndimage

from harness import DaemonTest

RANK = {6: 1, 18: 2, 26: 3}


def structure(neighbors):
    return ndimage.generate_binary_structure(3, RANK[neighbors])


def largest(occupied, count, neighbors):
    """The largest components; of equal ones the first by z, y, x, which is the order of scipy's numbers."""
    numbers, found = ndimage.label(occupied, structure(neighbors))
    sizes = np.bincount(numbers.ravel(), minlength=found + 1)[1:]
    return np.isin(numbers, 1 + np.argsort(-sizes, kind="stable")[:count])


class Morphology(DaemonTest):
    device = "cpu"

    def get(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/voxelize?filename={name}&{query}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def arrays(self, response):
        self.assertEqual(response.status, 200, response.body)
        return np.load(io.BytesIO(response.body))

    def npz(self, query, name="sample.glb"):
        return self.arrays(self.get(f"{query}&format=npz", name))

    def names(self, arrays):
        """The names of labels in the meta of an npz, by their numbers."""
        return {label["id"]: label["name"] for label in json.loads(bytes(arrays["meta"]))["labels"]}

    def error(self, response):
        self.assertEqual(response.status, 400, response.body)
        problem = json.loads(response.body)
        return problem["detail"], problem["expected"], problem["got"]

    def expected(self, occupied, kind, steps, neighbors):
        if kind == "keep":
            return largest(occupied, steps, neighbors)
        operation = ndimage.binary_dilation if kind == "dilate" else ndimage.binary_erosion
        changed = operation(occupied, structure(neighbors), iterations=steps)
        return occupied & ~changed if kind == "hollow" else changed

    def test_voxelize_and_exports_equal_scipy(self):
        query = "size=270&padding=6&fill=solid&color=none"
        stored = self.get(query)
        grid = stored.headers["x-voxeld-grid"]
        whole = self.arrays(self.daemon.get(f"/v1/grids/{grid}?format=npz"))["occupancy"] > 0
        for neighbors in RANK:
            for kind, steps in (("keep", 2), ("dilate", 3), ("erode", 2), ("hollow", 2)):
                with self.subTest(kind=kind, neighbors=neighbors):
                    options = f"{kind}={steps}&neighbors={neighbors}&format=npz"
                    made = self.arrays(self.daemon.get(f"/v1/grids/{grid}?{options}"))["occupancy"]
                    wanted = self.expected(whole, kind, steps, neighbors)
                    self.assertGreater(wanted.sum(), 0)
                    np.testing.assert_array_equal(made > 0, wanted)
        made = self.npz(f"{query}&hollow=3&neighbors=18")["occupancy"]
        np.testing.assert_array_equal(made > 0, self.expected(whole, "hollow", 3, 18))

    def test_stages_have_an_order_and_crop_and_mirror_come_after(self):
        query = "size=70&padding=4"
        whole = self.npz(query)["occupancy"] > 0
        wanted = largest(whole, 1, 26)
        for kind, steps in (("dilate", 2), ("erode", 1), ("hollow", 1)):
            wanted = self.expected(wanted, kind, steps, 26)
        used = np.argwhere(wanted)
        (z0, y0, x0), (z1, y1, x1) = used.min(0), used.max(0) + 1
        response = self.get(query + "&keep=largest&dilate=2&erode=1&hollow=1&neighbors=26&crop=yes&mirror=x&format=npz")
        made = self.arrays(response)["occupancy"] > 0
        np.testing.assert_array_equal(made, np.flip(wanted[z0:z1, y0:y1, x0:x1], 2))
        meta = json.loads(response.headers["x-voxeld-meta"])
        facts = {name: meta[name] for name in ("keep", "dilate", "erode", "hollow", "neighbors", "mirror")}
        self.assertEqual(facts, {"keep": 1, "dilate": 2, "erode": 1, "hollow": 1, "neighbors": "26", "mirror": "x"})
        self.assertEqual(meta["region"], [int(v) for v in (x0, y0, z0, x1, y1, z1)])

    def test_voxels_that_remain_keep_their_values(self):
        whole = self.npz("size=60&padding=3")
        for options in ("keep=1", "hollow=1", "dilate=2"):
            made = self.npz(f"size=60&padding=3&{options}")
            both = (made["occupancy"] > 0) & (whole["occupancy"] > 0)
            self.assertGreater(both.sum(), 0)
            np.testing.assert_array_equal(made["color"][both], whole["color"][both])
            self.assertTrue((made["color"][made["occupancy"] == 0] == 0).all())

    def test_frames_equal_scipy(self):
        query = "size=40&animation=0&frames=0..3&padding=4"
        whole = self.npz(query, "spin.glb")["occupancy"] > 0
        wanted = np.stack([self.expected(frame, "dilate", 2, 18) for frame in whole])
        made = self.npz(query + "&dilate=2&neighbors=18", "spin.glb")["occupancy"] > 0
        np.testing.assert_array_equal(made, wanted)
        used = np.argwhere(wanted.any(0))
        (z0, y0, x0), (z1, y1, x1) = used.min(0), used.max(0) + 1
        made = self.npz(query + "&dilate=2&neighbors=18&crop=yes", "spin.glb")["occupancy"] > 0
        np.testing.assert_array_equal(made, wanted[:, z0:z1, y0:y1, x0:x1])

    def test_labels_and_their_names_have_other_numbers(self):
        query = "size=50&channels=label&labels=material"
        grid = self.get(query).headers["x-voxeld-grid"]
        whole = self.npz(query)
        before = self.names(whole)
        top = int(whole["label"].max())
        self.assertGreater(top, 1)
        changes = f"remap=1:{top + 5},2:{top + 5}"
        for made in (self.npz(f"{query}&{changes}"),
                     self.arrays(self.daemon.get(f"/v1/grids/{grid}?format=npz&{changes}"))):
            wanted = np.where(np.isin(whole["label"], (1, 2)), top + 5, whole["label"])
            np.testing.assert_array_equal(made["label"], wanted)
            kept = {number: name for number, name in before.items() if number > 2}
            self.assertEqual(self.names(made), {**kept, top + 5: before[1]})

    def test_nothing_remains_where_all_is_eroded(self):
        made = self.npz("size=40&erode=64")
        self.assertEqual(made["occupancy"].sum(), 0)
        self.assertEqual(made["occupancy"].shape, self.npz("size=40")["occupancy"].shape)

    def test_what_a_grid_cannot_do_is_refused(self):
        mesh = self.fixture("sample.glb")

        def voxelize(query):
            return self.error(self.daemon.post(f"/v1/voxelize?filename=sample.glb&size=30&{query}", mesh))

        self.assertEqual(voxelize("dilate=65"), ("dilate", "an integer from 0 to 64", '"65"'))
        self.assertEqual(voxelize("keep=none"), ("keep", "largest, or 0 (all) to 1000000", '"none"'))
        self.assertEqual(voxelize("fill=band&dilate=1"), ("dilate", "channels without distance", '"distance"'))
        self.assertEqual(voxelize("remap=1:2"), ("remap", "channels with label", '"channels without it"'))
        band = self.get("size=30&fill=band").headers["x-voxeld-grid"]
        self.assertEqual(self.error(self.daemon.get(f"/v1/grids/{band}?dilate=1")),
                         ("dilate: distances of added voxels are not known", "a grid without channel distance",
                          "distance"))
        plain = self.get("size=30&color=none").headers["x-voxeld-grid"]
        self.assertEqual(self.error(self.daemon.get(f"/v1/grids/{plain}?remap=1:2&format=npz")),
                         ("remap: the grid has no labels", "channel label", "occupancy"))
