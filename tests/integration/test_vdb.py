"""VDB files, by OpenVDB's own library and vdb_print, against the npz of the same grid."""
import io
import json
import pathlib
import re
import subprocess
import tempfile
import unittest
import zipfile

import numpy as np
import pyopenvdb

from harness import DaemonTest

SURFACE = "size=61&channels=color,normal,label&labels=material"
SOLID = "size=48&fill=solid&channels=color,material,coverage"
BAND = "size=40&fill=band"
DISTANCES = "size=40&fill=solid&channels=distance"
PLACES = ("", "&level=1", "&region=10,5,3,36,17,18", "&region=10,5,3,36,17,18&level=1")


def linear(srgb):
    s = srgb.astype(float) / 255
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4).astype(np.float32)


class Vdb(DaemonTest):
    def voxelize(self, query, name="sample.obj.zip"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query, name="sample.obj.zip"):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz&axes=xyz", name).body))

    def file(self, query, name="sample.obj.zip"):
        """A path of the file, in a folder that the test removes."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = pathlib.Path(folder.name) / "a.vdb"
        response = self.voxelize(query + "&format=vdb", name)
        self.assertEqual(response.headers["Content-Type"], "application/x-vdb")
        path.write_bytes(response.body)
        return str(path)

    def printed(self, path):
        """The text of vdb_print for each grid, by name."""
        text = subprocess.run(["vdb_print", "-l", path], check=True, capture_output=True, text=True).stdout
        parts = [part.split("\n", 1) for part in text.split("\nName: ")[1:]]
        return {name: dict(re.findall(r"^ *([^:\n]+): +(.*)$", facts, re.M)) for name, facts in parts}

    def grids(self, path):
        """The grids of types that Debian's pyopenvdb knows, which are not those of ids."""
        known = [name for name in self.printed(path) if name not in ("label", "material")]
        return {name: pyopenvdb.read(path, name) for name in known}

    def array(self, grid, dims, components=()):
        """The values of all cells, and which are active."""
        values = np.zeros((*dims, *components), np.float32)
        grid.copyToArray(values)
        active = np.zeros(dims, bool)
        for item in grid.iterOnValues():
            low, high = np.array(item.min), np.array(item.max) + 1
            self.assertTrue((low >= 0).all() and (high <= dims).all(), (low, high))
            part = active[tuple(map(slice, low, high))]
            self.assertFalse(part.any())
            part[:] = True
        return values, active

    def check_place(self, grid, npz):
        for index in ((0, 0, 0), (5, 6, 7), (-3, 100, 2)):
            centre = npz["origin"] + (np.array(index) + 0.5) * npz["voxel_size"]
            np.testing.assert_allclose(grid.transform.indexToWorld(index), centre, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(grid.transform.worldToIndex(centre), index, atol=1e-6)

    def check(self, query, name="sample.obj.zip"):
        npz = self.npz(query, name)
        dims, occupied = npz["occupancy"].shape, npz["occupancy"] == 1
        path = self.file(query, name)
        grids = self.grids(path)
        known = npz["color"][..., 3] > 0 if "color" in npz.files else occupied  # with a colour of their own
        for name, grid in grids.items():
            self.check_place(grid, npz)
            with self.subTest(query=query, grid=name):
                vector = name in ("color", "normal")
                values, active = self.array(grid, dims, (3,) if vector else ())
                self.assertEqual(grid.activeVoxelCount(), active.sum())
                self.assertEqual(grid["file_voxel_count"], active.sum())
                if active.any():
                    self.assertEqual(grid.evalActiveVoxelBoundingBox(),
                                     (grid["file_bbox_min"], grid["file_bbox_max"]))
                self.assertTrue((active == occupied).all())
                self.check_values(name, values, known, npz)
                accessor = grid.getConstAccessor()
                for cell in np.argwhere(occupied)[::97].tolist():
                    self.assertTrue((np.array(accessor.getValue(cell)) == values[tuple(cell)]).all())
        return path, grids, npz

    def check_values(self, name, values, known, npz):
        occupied = npz["occupancy"] == 1
        if name == "density":
            wanted = npz["coverage"].astype(np.float32) / np.float32(255) if "coverage" in npz.files else occupied
            self.assertTrue((values == wanted).all())
        elif name == "surface":
            size, = set(npz["voxel_size"].tolist())
            self.assertTrue((values == (npz["distance"].astype(float) * size).astype(np.float32)).all())
        elif name == "color":
            np.testing.assert_allclose(values[known], linear(npz["color"][..., :3])[known], rtol=1e-6)
            inside = np.unique(values[occupied & ~known], axis=0)
            self.assertLessEqual(len(inside), 1)  # the mean
        elif name == "normal":
            self.assertTrue((values == npz["normal"].astype(np.float32) / np.float32(127)).all())
        else:
            self.assertEqual(name, "alpha")
            alpha = npz["color"][..., 3].astype(np.float32) / np.float32(255)
            self.assertTrue((values[known] == alpha[known]).all())
            self.assertTrue((values[occupied & ~known] == 1).all())

    def test_grids_have_the_arrays_of_the_npz_and_their_place(self):
        for query, names in ((SURFACE, {"density", "color", "normal"}), (SOLID, {"density", "color"}),
                             (BAND, {"surface", "color"}), (DISTANCES, {"density", "surface"})):
            for place in PLACES:
                _, grids, _ = self.check(query + place)
                self.assertEqual({name for name in grids if name != "alpha"}, names)

    def test_names_that_are_not_utf8_are_written(self):
        mesh = b"g caf\xe9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
        query = "size=8&channels=label&labels=group&format=vdb&filename=a.obj"
        response = self.daemon.post("/v1/voxelize?" + query, mesh)
        self.assertEqual(response.status, 200, response.body)
        self.assertIn('{"1":"caf\ufffd"}'.encode(), response.body)

    def test_a_solid_without_attributes_inside_has_its_tiles(self):
        path, grids, _ = self.check("size=120&fill=solid", "sample.off")
        self.assertGreater(grids["density"].activeVoxelCount(), 100_000)
        self.assertLess(grids["density"].leafCount(), 10_000)
        self.assertLess(pathlib.Path(path).stat().st_size, 1e6)

    def test_voxels_that_are_no_cubes_have_their_sizes(self):
        query = "dims=20,30,16&bounds=-1,-1,-1,1,3,1&channels=color,distance"
        grids, npz = self.grids(self.file(query)), self.npz(query)
        for grid in grids.values():
            self.check_place(grid, npz)
            np.testing.assert_allclose(grid.transform.voxelSize(), npz["voxel_size"])
        values, _ = self.array(grids["surface"], npz["occupancy"].shape)
        self.assertTrue((values == npz["distance"]).all())  # in voxels
        self.assertEqual(grids["surface"].gridClass, pyopenvdb.GridClass.UNKNOWN)

    def test_classes_and_metadata(self):
        path, grids, npz = self.check(SURFACE + "&units=mm")
        self.assertEqual(grids["density"].gridClass, pyopenvdb.GridClass.FOG_VOLUME)
        self.assertEqual(grids["color"].vectorType, pyopenvdb.VectorType.INVARIANT)
        self.assertEqual(grids["normal"].vectorType, pyopenvdb.VectorType.COVARIANT_NORMALIZE)
        meta = pyopenvdb.readMetadata(path)
        self.assertEqual((meta["creator"], meta["units"]), ("voxeld", "mm"))
        self.assertEqual(json.loads(meta["meta"])["dims"], list(npz["occupancy"].shape))
        self.assertEqual(json.loads(self.printed(path)["label"]["names"]),
                         {"1": "brick wall", "2": "wood", "3": "roof tiles", "4": "leaves"})
        for query in (BAND, DISTANCES):
            grid = self.grids(self.file(query))["surface"]
            self.assertEqual(grid.gridClass, pyopenvdb.GridClass.LEVEL_SET)
            self.assertLess(grid.evalMinMax()[0], 0)

    def test_a_level_set_meshes_as_one_closed_surface(self):
        grid = self.grids(self.file("size=60&fill=band", "sample.off"))["surface"]
        points, triangles, quads = grid.convertToPolygons()
        self.assertGreater(len(points), 1000)
        edges = {}
        for face in [*triangles.tolist(), *quads.tolist()]:
            for a, b in zip(face, face[1:] + face[:1]):
                edges[min(a, b), max(a, b)] = edges.get((min(a, b), max(a, b)), 0) + 1
        self.assertEqual(set(edges.values()), {2})

    def test_signs_are_those_of_openvdbs_own_flood(self):
        query = "size=150&fill=band&padding=4"
        for name in ("sample.off", "sample.obj.zip"):
            grid = self.grids(self.file(query, name))["surface"]
            flooded = grid.deepCopy()
            flooded.signedFloodFill()
            values = np.zeros(self.npz(query, name)["occupancy"].shape, np.float32)
            wanted = values.copy()
            grid.copyToArray(values)
            flooded.copyToArray(wanted)
            self.assertTrue((values == wanted).all())
            self.assertGreater((values == -grid.background).sum(), 1000)

    def test_vdb_print_reads_grids_of_ids(self):
        for query, name in ((SURFACE, "label"), (SOLID, "material")):
            for place in PLACES:
                facts, npz = self.printed(self.file(query + place))[name], self.npz(query + place)
                self.assertEqual(facts["Type"], "Tree_int32_5_4_3")
                occupied = npz["occupancy"] == 1
                ids = npz[name][occupied]
                self.assertEqual((int(facts["Min value"]), int(facts["Max value"])), (ids.min(), ids.max()))
                self.assertEqual(int(facts["Number of active voxels"].replace(",", "")), occupied.sum())
                cells = np.argwhere(occupied)
                low, high = cells.min(0).tolist(), cells.max(0).tolist()
                self.assertEqual(facts["Bounding box of active voxels"], f"{low} -> {high}")

    def test_an_empty_grid_and_frames(self):
        grids = self.grids(self.file(SURFACE + "&region=0,0,0,2,2,2"))
        self.assertEqual({grid.activeVoxelCount() for grid in grids.values()}, {0})
        query = SURFACE + "&format=vdb&cache=no"
        self.assertEqual(self.voxelize(query).body, self.voxelize(query).body)
        response = self.voxelize("size=20&animation=spin&frames=0..2&format=vdb", "spin.glb")
        with zipfile.ZipFile(io.BytesIO(response.body)) as archive, tempfile.TemporaryDirectory() as folder:
            self.assertEqual(archive.namelist(), [f"frame-000{i}.vdb" for i in range(3)])
            for name in archive.namelist():
                self.assertGreater(pyopenvdb.read(archive.extract(name, folder), "density").activeVoxelCount(), 100)


if __name__ == "__main__":
    unittest.main()
