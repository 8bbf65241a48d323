"""Outputs, read by independent readers: numpy, goxel, and the reader of the documentation."""
import io
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import urllib.parse
import zipfile

import numpy as np

from harness import ROOT, DaemonTest

sys.path.insert(0, str(ROOT / "docs"))


class Formats(DaemonTest):
    def voxelize(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz").body))

    def test_axes_and_dtype_of_npy(self):
        base = np.load(io.BytesIO(self.voxelize("size=31&format=npy").body))
        for dtype, expected in (("uint8", np.uint8), ("bool", np.bool_), ("float32", np.float32)):
            grid = np.load(io.BytesIO(self.voxelize(f"size=31&format=npy&dtype={dtype}").body))
            self.assertEqual(grid.dtype, expected)
            self.assertTrue((grid.astype(bool) == base.astype(bool)).all())
        xyz = np.load(io.BytesIO(self.voxelize("size=31&format=npy&axes=xyz").body))
        self.assertTrue((xyz == base.transpose(2, 1, 0)).all())

    def check_sparse(self, sparse, dense, names):
        """The rows are the occupied cells of the dense arrays, by ascending Morton code."""
        self.assertEqual(sorted(sparse), sorted(["coords", "dims", "meta", "origin", "voxel_size", *names]))
        coords = sparse["coords"]
        self.assertEqual(coords.dtype, np.int32)
        self.assertEqual(tuple(sparse["dims"][::-1]), dense["occupancy"].shape)
        occupied = np.argwhere(dense["occupancy"])[:, ::-1]
        self.assertEqual(coords.shape, occupied.shape)
        codes = sum(((coords[:, c].astype(np.int64) >> bit & 1) << 3 * bit + c)
                    for bit in range(14) for c in range(3))
        self.assertTrue((np.diff(codes) > 0).all())
        x, y, z = coords.T
        self.assertTrue(dense["occupancy"][z, y, x].all())
        for name in names:
            self.assertTrue((sparse[name] == dense[name][z, y, x]).all(), name)
        for name in ("origin", "voxel_size"):
            self.assertTrue((sparse[name] == dense[name]).all())

    def test_sparse_arrays_are_the_rows_of_dense_ones(self):
        query = "size=61&fill=solid&channels=color,normal,label,material,coverage"
        names = ("color", "normal", "label", "material", "coverage")
        for more in ("", "&dtype=float32", "&level=2", "&region=10,5,0,36,60,31"):
            self.check_sparse(self.npz(query + more + "&layout=sparse"), self.npz(query + more), names)
        coords = np.load(io.BytesIO(self.voxelize(query + "&layout=sparse&format=npy").body))
        self.assertTrue((coords == self.npz(query + "&layout=sparse")["coords"]).all())

    def test_sparse_arrays_of_frames_have_their_number_first(self):
        dense, sparse = (np.load(io.BytesIO(self.frames("npz" + more))) for more in ("", "&layout=sparse"))
        frame, x, y, z = sparse["coords"].T
        self.assertTrue((np.diff(frame) >= 0).all())
        self.assertEqual(len(frame), np.count_nonzero(dense["occupancy"]))
        self.assertTrue(dense["occupancy"][frame, z, y, x].all())
        self.assertTrue((sparse["color"] == dense["color"][frame, z, y, x]).all())
        self.assertTrue((sparse["times"] == dense["times"]).all())
        coords = np.load(io.BytesIO(self.frames("npy&layout=sparse")))
        self.assertTrue((coords == sparse["coords"]).all())

    def test_a_grid_too_large_for_dense_arrays_has_sparse_ones(self):
        small = "transform=0.03,0,0,0,0,0.03,0,0,0,0,0.03,0,0,0,0,1"
        query = f"size=2048&bounds=-1,-1,-1,1,1,1&{small}"
        coords = np.load(io.BytesIO(self.voxelize(query + "&format=npy&layout=sparse").body))
        begin, end = coords.min(axis=0), coords.max(axis=0) + 1
        self.assertGreater((end - begin).max(), 10)
        region = ",".join(map(str, [*begin, *end]))
        dense = self.npz(f"{query}&region={region}")["occupancy"]
        self.assertEqual(dense.shape, tuple(end - begin)[::-1])
        self.assertEqual(np.count_nonzero(dense), len(coords))
        x, y, z = (coords - begin).T
        self.assertTrue(dense[z, y, x].all())

    def test_accept_and_results_in_other_formats_take_the_layout(self):
        body = self.fixture("sample.glb")
        sparse = self.npz("size=24&layout=sparse")
        response = self.daemon.request("POST", "/v1/voxelize?size=24&layout=sparse&filename=sample.glb", body,
                                       {"Accept": "application/x-npz"})
        self.assertEqual(response.status, 200, response.body)
        self.assertTrue((np.load(io.BytesIO(response.body))["coords"] == sparse["coords"]).all())
        job = self.voxelize("size=24").headers["X-Voxeld-Job"]
        for path, headers in ((f"/v1/jobs/{job}/result?format=npz&layout=sparse", {}),
                              (f"/v1/jobs/{job}/result?layout=sparse", {"Accept": "application/x-npz"})):
            response = self.daemon.request("GET", path, None, headers)
            self.assertEqual(response.status, 200, response.body)
            self.assertTrue((np.load(io.BytesIO(response.body))["coords"] == sparse["coords"]).all())

    def test_layout_without_arrays_is_refused(self):
        for query, name, expected in (("format=vox&layout=sparse", "layout", "format npy or npz with it"),
                                      ("layout=sparse", "layout", "format npy or npz with it"),
                                      ("format=npz&layout=sparse&axes=xyz", "axes", "zyx, or layout dense")):
            response = self.daemon.post("/v1/voxelize?filename=sample.glb&" + query, self.fixture("sample.glb"))
            self.assertEqual(response.status, 400, response.body)
            problem = response.json()
            self.assertEqual((problem["detail"], problem["expected"]), (name, expected))

    def test_points_are_the_centres_and_colours_of_the_npz(self):
        def expected(grid, occupancy, color):
            z, y, x = np.nonzero(occupancy)
            centres = (np.stack([x, y, z], 1) + 0.5) * grid["voxel_size"] + grid["origin"]
            return np.concatenate([centres, color[z, y, x, :3]], 1)

        def same(text, rows):
            points = np.loadtxt(io.BytesIO(text), ndmin=2)
            self.assertEqual(points.shape, rows.shape)
            order, wanted = np.lexsort(points.T), np.lexsort(rows.T)
            np.testing.assert_allclose(points[order], rows[wanted], rtol=0, atol=1e-9)

        grid = self.npz("size=33")
        points = self.voxelize("size=33&format=xyz")
        self.assertEqual(points.headers["Content-Type"], "text/x-xyz")
        same(points.body, expected(grid, grid["occupancy"], grid["color"]))
        frames = np.load(io.BytesIO(self.frames("npz")))
        archive = zipfile.ZipFile(io.BytesIO(self.frames("xyz")))
        self.assertEqual(archive.namelist(), [f"frame-{i:04}.xyz" for i in range(6)])
        for i in range(6):
            text = archive.read(f"frame-{i:04}.xyz")
            same(text, expected(frames, frames["occupancy"][i], frames["color"][i]))

    def test_meta_of_an_npz_has_the_warnings_with_their_texts(self):
        mesh = b"mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl skin\nf 1 2 3\n"
        response = self.daemon.post("/v1/voxelize?size=8&format=npz&filename=a.obj", mesh)
        meta = json.loads(np.load(io.BytesIO(response.body))["meta"].tobytes())
        self.assertIn("missing-material-file", [one["code"] for one in meta["warnings"]])
        self.assertIn("gone.mtl", meta["warnings"][0]["detail"])
        # Another format that is made of the stored grid says the same.
        job = response.headers["x-voxeld-job"]
        again = self.daemon.get(f"/v1/jobs/{job}/result?format=npz&axes=xyz")
        meta_again = json.loads(np.load(io.BytesIO(again.body))["meta"].tobytes())
        self.assertEqual(meta_again["warnings"], meta["warnings"])

    def test_a_grid_with_warnings_is_the_same_whatever_its_upload_was_called(self):
        mesh = (b"mtllib gone.mtl\nusemtl skin\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 nan\n"
                b"f 1//1 2//1 3//7\n")
        grids = set()
        for name in ("a.obj", "of.obj", "named by.obj"):
            response = self.daemon.post("/v1/voxelize?size=8&format=native&cache=no&filename=" +
                                        urllib.parse.quote(name), mesh)
            grids.add(response.headers["X-Voxeld-Grid"])
            # The response has the name; the container does not.
            job = self.daemon.get(f"/v1/jobs/{response.headers['X-Voxeld-Job']}").json()
            details = [warning["detail"] for warning in job["result"]["warnings"]]
            self.assertEqual(len(details), 4)
            for detail in details:
                self.assertTrue(detail.startswith(f"{name}: ") or f", named by {name}, " in detail, detail)
            self.assertNotIn(name.encode(), response.body)
        self.assertEqual(len(grids), 1)
        self.assertNotIn(None, grids)

    def test_the_documented_reader_gives_the_same_grid_as_npz(self):
        import read_grid
        query = "size=300&channels=occupancy,color,normal"
        native = self.voxelize(query + "&format=native").body
        grid = read_grid.read_grid(native)
        dense = self.npz(query)
        self.assertEqual(tuple(grid["dims"]), dense["occupancy"].shape[::-1])
        np.testing.assert_array_equal(np.asarray(grid["origin"]), dense["origin"])
        np.testing.assert_array_equal(np.asarray(grid["voxel_size"]), dense["voxel_size"])
        cells = np.asarray(grid["cells"])
        occupied = np.zeros_like(dense["occupancy"])
        occupied[cells[:, 2], cells[:, 1], cells[:, 0]] = 1
        self.assertTrue((occupied == dense["occupancy"]).all())
        self.assertTrue((dense["color"][cells[:, 2], cells[:, 1], cells[:, 0]] ==
                         np.asarray(grid["color"])).all())
        self.assertTrue((dense["normal"][cells[:, 2], cells[:, 1], cells[:, 0]] ==
                         np.asarray(grid["normal"])).all())
        self.assertLess(len((ROOT / "docs/read_grid.py").read_text().splitlines()), 75)

    def test_materials_and_coverage_are_the_same_in_npz_and_native_and_are_named(self):
        import read_grid
        query = "size=120&channels=material,coverage"
        native = self.voxelize(query + "&format=native").body
        grid = read_grid.read_grid(native)
        dense = self.npz(query)
        cells = np.asarray(grid["cells"])
        for name, dtype in (("material", np.uint16), ("coverage", np.uint8)):
            self.assertEqual(dense[name].dtype, dtype)
            self.assertEqual(dense[name].shape, dense["occupancy"].shape)
            got = dense[name][cells[:, 2], cells[:, 1], cells[:, 0]]
            self.assertTrue((got == grid[name][:, 0]).all())
        meta = json.loads(bytes(dense["meta"]))
        self.assertEqual(meta["channels"], ["occupancy", "material", "coverage"])
        self.assertEqual(meta["materials"], grid["meta"]["materials"])
        names = {entry["id"]: entry["name"] for entry in meta["materials"]}
        used = set(np.unique(grid["material"]).tolist())
        self.assertGreater(len(used), 1)
        self.assertLessEqual(used - {0}, set(names))
        self.assertGreater(np.mean(grid["coverage"]), 60)
        refused = self.daemon.post("/v1/voxelize?size=9&fill=shell&channels=coverage"
                                   "&filename=sample.glb", self.fixture("sample.glb"))
        self.assertEqual(refused.status, 400, refused.body)
        self.assertIn(b"fill surface or solid with coverage", refused.body)
        small = self.voxelize(query + "&format=native&codec=small")
        self.assertEqual(small.body[104:111], bytes([1, 0, 0, 1, 0, 0, 1]))
        self.assertLess(len(small.body), len(native))

    def test_coverage_of_a_solid_is_the_part_of_its_volume(self):
        dense = self.npz("size=70&fill=solid&sign=majority&channels=coverage")
        coverage, solid = dense["coverage"], dense["occupancy"] != 0
        self.assertTrue((coverage[~solid] == 0).all())
        self.assertGreater(len(np.unique(coverage)), 32)
        # Cells are solid where their centres are, or where the surface is: the mean is between.
        centres = self.npz("size=70&fill=solid&sign=majority&rule=none")["occupancy"]
        self.assertLess(coverage.sum() / 255, solid.sum())
        self.assertAlmostEqual(coverage.sum() / 255 / (centres != 0).sum(), 1, delta=0.03)
        flood = self.daemon.post("/v1/voxelize?size=9&fill=solid&sign=flood&channels=coverage"
                                 "&filename=sample.glb", self.fixture("sample.glb"))
        self.assertEqual(flood.status, 400, flood.body)
        self.assertIn(b"flood", flood.body)

    def test_labels_are_the_same_in_npz_and_native_and_are_named(self):
        import read_grid
        names = {"mesh": ["house", "trees"], "node": ["house", "trees"], "group": [""],
                 "material": ["brick wall", "wood", "roof tiles", "leaves"]}
        for kind, expected in names.items():
            query = f"size=90&channels=label,material&labels={kind}"
            native = self.voxelize(query + "&format=native", "sample.obj.zip").body
            grid = read_grid.read_grid(native)
            meta = grid["meta"]
            self.assertEqual(meta["labels"],
                             [{"id": i + 1, "name": name} for i, name in enumerate(expected)])
            self.assertEqual(meta["options"]["labels"], kind)
            self.assertEqual(meta["channels"], ["occupancy", "material", "label"])
            used = set(np.unique(grid["label"]).tolist())
            self.assertEqual(used, set(range(1, len(expected) + 1)))
            if kind == "material":
                self.assertTrue((grid["label"] == grid["material"]).all())
            response = self.voxelize(query + "&format=npz", "sample.obj.zip")
            dense = np.load(io.BytesIO(response.body))
            cells = np.asarray(grid["cells"])
            self.assertEqual(dense["label"].dtype, np.uint16)
            self.assertTrue((dense["label"][cells[:, 2], cells[:, 1], cells[:, 0]] ==
                             grid["label"][:, 0]).all())
            self.assertEqual(json.loads(bytes(dense["meta"]))["labels"], meta["labels"])
        # No part of the house is to the left of its left tree: x is the first axis of cells.
        query = "size=90&channels=label&labels=mesh"
        grid = read_grid.read_grid(self.voxelize(query, "sample.obj.zip").body)
        cells, label = np.asarray(grid["cells"]), np.asarray(grid["label"])[:, 0]
        house, trees = cells[label == 1], cells[label == 2]
        self.assertLess(trees[:, 0].min(), house[:, 0].min())
        self.assertGreater(trees[:, 0].max(), house[:, 0].max())

    def test_images_show_ids_where_there_is_no_colour(self):
        images = set()
        queries = ("occupancy", "label&labels=mesh", "label&labels=material", "material")
        for query in queries:
            response = self.daemon.post("/v1/render?size=40&width=64&height=64&filename=sample.obj.zip"
                                        "&channels=" + query, self.fixture("sample.obj.zip"))
            self.assertEqual(response.status, 200, response.body)
            images.add(response.body)
        self.assertEqual(len(images), len(queries) - 1)  # the last two are one

    def test_nearest_colours_are_the_same_by_each_pipeline_and_not_averages(self):
        query = "size=40&format=native&color="
        names = ("nearest", "nearest&pipeline=cpu", "nearest&pipeline=raster", "average")
        hashes = [self.voxelize(query + name).headers["X-Voxeld-Content-Hash"] for name in names]
        self.assertEqual(hashes[:2], [hashes[2]] * 2)
        self.assertNotEqual(hashes[0], hashes[3])

    def test_more_groups_than_ids_are_refused_and_only_where_groups_are_asked_for(self):
        lines = [b"v 0 0 0", b"v 1 0 0", b"v 0 1 0"]
        for i in range(100_000):
            lines += [b"g %d" % i, b"f 1 2 3"]
        body = b"\n".join(lines) + b"\n"
        path = "/v1/voxelize?size=9&filename=many.obj&channels=label&labels="
        refused = self.daemon.post(path + "group", body)
        self.assertEqual(refused.status, 400, refused.body)
        problem = refused.json()
        self.assertEqual(problem["code"], "invalid-option")
        self.assertIn("too many groups", problem["detail"])
        self.assertEqual(problem["expected"], "at most 65535")
        self.assertIn("more than 65535", problem["got"])
        self.assertEqual(self.daemon.post(path + "material", body).status, 200)

    def test_a_long_list_of_ids_is_complete_in_the_container_and_cut_in_the_response(self):
        import read_grid
        lines = []
        for i in range(40_000):
            x, y = i % 200, i // 200
            lines += [f"v {x} {y} 0", f"v {x + 1} {y} 0", f"v {x} {y + 1} 0", f"g part {i}",
                      "f -3 -2 -1"]
        made = self.daemon.post("/v1/voxelize?size=50&filename=many.obj&channels=label&labels=group"
                                "&format=native", "\n".join(lines).encode())
        self.assertEqual(made.status, 200, made.body)
        grid = read_grid.read_grid(made.body)
        labels = grid["meta"]["labels"]
        self.assertEqual(len(labels), 40_000)
        self.assertEqual(labels[-1], {"id": 40_000, "name": "part 39999"})
        self.assertGreater(len(np.unique(grid["label"])), 2400)
        job = self.daemon.get("/v1/jobs/" + made.headers["X-Voxeld-Job"]).json()
        meta = job["result"]["meta"]
        self.assertEqual(meta["labels_total"], 40_000)
        self.assertEqual(meta["labels"], labels[:len(meta["labels"])])
        self.assertGreater(len(meta["labels"]), 1000)

    def test_codec_small_is_smaller_and_gives_the_same_grid(self):
        query = "size=200&channels=occupancy,color,normal&format=native"
        fast = self.voxelize(query + "&codec=fast")
        small = self.voxelize(query + "&codec=small")
        self.assertEqual(fast.body[104:107], bytes([0, 0, 0]))
        self.assertEqual(small.body[104:107], bytes([1, 1, 1]))
        self.assertLess(len(small.body), 0.8 * len(fast.body))
        grid = small.headers["X-Voxeld-Grid"]
        self.assertEqual(grid, fast.headers["X-Voxeld-Grid"])
        stored = self.daemon.get(f"/v1/grids/{grid}")
        self.assertEqual(stored.body, fast.body)
        exported = self.daemon.get(f"/v1/grids/{grid}?codec=small")
        self.assertEqual(exported.body, small.body)

    def test_a_vox_above_256_opens_in_goxel(self):
        query = "size=300&channels=occupancy,color"
        dense = self.npz(query)
        with tempfile.TemporaryDirectory() as directory:
            vox = pathlib.Path(directory) / "a.vox"
            vox.write_bytes(self.voxelize(query + "&format=vox").body)
            text = pathlib.Path(directory) / "a.txt"
            subprocess.run(["xvfb-run", "-a", "goxel", vox, "-e", text], check=True,
                           capture_output=True, timeout=300,
                           env={**os.environ, "HOME": directory, "LIBGL_ALWAYS_SOFTWARE": "1"})
            cells = np.loadtxt(text, usecols=(0, 1, 2), dtype=int, comments="#")
        self.assertEqual(len(cells), int(dense["occupancy"].sum()))
        # z up: (x, -z, y); compare shapes after moving both to the origin.
        z, y, x = np.nonzero(dense["occupancy"])
        ours = np.stack([x, -z, y], axis=1)
        ours -= ours.min(axis=0)
        theirs = cells - cells.min(axis=0)
        self.assertEqual({tuple(c) for c in ours}, {tuple(c) for c in theirs})

    def frames(self, fmt):
        """A sequence of six frames whose last two are equal."""
        query = f"animation=walk&size=40&channels=color,normal&format={fmt}"
        return self.voxelize(query, "worm.md5.zip").body

    def test_frames_of_the_documented_reader_are_those_of_the_npz(self):
        import read_sequence
        sequence = read_sequence.Sequence(self.frames("native"))
        dense = np.load(io.BytesIO(self.frames("npz")))
        np.testing.assert_array_equal(sequence.times, dense["times"])
        self.assertEqual(dense["occupancy"].shape, (6, *sequence.dims[::-1]))
        np.testing.assert_array_equal(sequence.origin, dense["origin"])
        for index in (5, 0, 3, 1, 2, 4):
            frame = sequence.frame(index)
            at = (index, *frame["cells"].T[::-1])
            self.assertEqual(np.count_nonzero(dense["occupancy"][index]), len(frame["cells"]))
            self.assertTrue(dense["occupancy"][at].all())
            for name in ("color", "normal"):
                self.assertTrue((dense[name][at] == frame[name]).all(), (name, index))
        self.assertEqual(sequence.frames[4][2], sequence.frames[5][2])
        self.assertLess(len((ROOT / "docs/read_sequence.py").read_text().splitlines()), 75)
        npy = np.load(io.BytesIO(self.frames("npy")))
        self.assertTrue((npy == dense["occupancy"]).all())

    def test_an_animated_vox_has_the_frames_of_the_npz(self):
        sys.path.insert(0, str(ROOT / "tests/unit/formats"))
        from vox_scene import Vox
        vox = Vox(self.frames("vox"))
        dense = np.load(io.BytesIO(self.frames("npz")))["occupancy"]
        self.assertEqual((vox.version, vox.range), (200, "0 5"))
        _, depth, _, width = dense.shape
        for index in range(6):
            z, y, x = np.nonzero(dense[index])
            cells = np.stack([x - width // 2, depth - 1 - z - depth // 2, y], 1)
            self.assertEqual({tuple(c) for c in vox.frame(index)[:, :3]}, {tuple(c) for c in cells})

    def test_every_format_carries_dims_origin_and_voxel_size(self):
        dense = self.npz("size=20")
        meta = json.loads(bytes(dense["meta"]))
        self.assertEqual(meta["dims"], list(dense["occupancy"].shape[::-1]))
        vox = self.voxelize("size=20&format=vox").body
        self.assertIn(b"voxel_size", vox)
        self.assertIn(b"origin", vox)
        npy = self.voxelize("size=20&format=npy")
        self.assertEqual(json.loads(npy.headers["X-Voxeld-Meta"])["dims"], meta["dims"])
        self.assertEqual(json.loads(npy.headers["X-Voxeld-Meta"])["origin"], meta["origin"])

    def test_a_mesh_without_colours_gets_none(self):
        response = self.daemon.post("/v1/voxelize?size=20&format=npz&filename=sample.off",
                                    self.fixture("sample.off"))
        self.assertNotIn("color", np.load(io.BytesIO(response.body)))

    def test_axis_colours_are_red_green_and_blue(self):
        box = (b"OFF\n8 6 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n"
               b"4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 2 3 7 6\n4 0 4 7 3\n4 1 2 6 5\n")
        response = self.daemon.post("/v1/voxelize?size=9&color=axis&format=npz&filename=a.off", box)
        grid = np.load(io.BytesIO(response.body))
        middle = {"x": grid["color"][4, 4, 0], "y": grid["color"][4, 0, 4], "z": grid["color"][0, 4, 4]}
        self.assertEqual([list(middle[a][:3]) for a in "xyz"],
                         [[255, 0, 0], [0, 255, 0], [0, 0, 255]])

    def test_placements(self):
        self.assertEqual(self.npz("dims=10,40,20")["occupancy"].shape, (20, 40, 10))
        cropped = self.npz("dims=16,8,4&bounds=-1,-1,-1,1,1,1")
        self.assertEqual(cropped["occupancy"].shape, (4, 8, 16))
        np.testing.assert_allclose(cropped["voxel_size"], [2 / 16, 2 / 8, 2 / 4])
        np.testing.assert_allclose(cropped["origin"], [-1, -1, -1])
        padded = self.npz("size=24&padding=3")["occupancy"]
        self.assertEqual(max(padded.shape), 24)
        self.assertEqual(padded[:3].sum() + padded[-3:].sum(), 0)


if __name__ == "__main__":
    unittest.main()
