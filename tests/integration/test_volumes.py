"""Volumes, points and Qubicle files, by readers of their own and compared with the npz of the same grid."""
import gzip
import io
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import zipfile

import nibabel
import numpy as np

from harness import ROOT, DaemonTest

sys.path.insert(0, str(ROOT / "tests/reference"))
import volume_readers as readers  # noqa: E402

ONE_ARRAY = {"nrrd": readers.read_nrrd, "mha": readers.read_mha, "nii": readers.read_nii}
SURFACE = "size=61&channels=color,normal,label&labels=material"
SOLID = "size=48&fill=solid&channels=color,material,coverage"
BAND = "size=40&fill=band"
PLACES = ("", "&level=1", "&region=10,5,3,36,17,18", "&region=10,5,3,36,17,18&level=1")
MEDIA_TYPES = {"vti": "application/x-vti", "nrrd": "application/x-nrrd", "mha": "application/x-metaimage",
               "nii": "application/x-nifti", "binvox": "application/x-binvox", "csv": "text/csv",
               "pcd": "application/x-pcd", "qb": "model/x-qubicle-qb"}


class Volumes(DaemonTest):
    def voxelize(self, query, name="sample.obj.zip"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz").body))

    def expected(self, grid, name):
        """The array of the npz; distances become world units."""
        if name != "distance":
            return grid[name]
        size, = set(grid["voxel_size"].tolist())
        return (grid["distance"].astype(float) * size).astype(np.float32)

    def channels(self, grid):
        return [name for name in grid.files if name not in ("origin", "voxel_size", "meta")]

    def check_place(self, volume, grid, rtol=1e-12):
        np.testing.assert_allclose(volume.spacing, grid["voxel_size"], rtol=rtol)
        np.testing.assert_allclose(volume.corner(), grid["origin"], rtol=0, atol=max(rtol, 1e-12) * 10)

    def check_same(self, got, wanted, name):
        self.assertEqual((got.shape, got.dtype), (wanted.shape, wanted.dtype), name)
        self.assertTrue((got == wanted).all(), name)

    def test_a_vti_has_every_array_of_the_npz_and_its_place(self):
        for query in (SURFACE, SOLID, BAND):
            for place in PLACES + ("&dtype=float32",):
                grid = self.npz(query + place)
                response = self.voxelize(query + place + "&units=mm&format=vti")
                volume = readers.read_vti(response.body)
                self.assertEqual(list(volume.arrays), self.channels(grid))
                for name in self.channels(grid):
                    self.check_same(volume.arrays[name], self.expected(grid, name), (query, place, name))
                self.check_place(volume, grid)
                self.assertEqual((volume.fields["units"], volume.fields["up"]), (["mm"], ["y"]))
                meta = json.loads(volume.fields["meta"][0])
                self.assertEqual(meta["dims"], list(grid["occupancy"].shape[::-1]))
                # The mesh is open.
                self.assertEqual(response.headers.get("X-Voxeld-Warnings"),
                                 "ambiguous-solid" if query is SOLID else None)
        volume = readers.read_vti(self.voxelize(SURFACE + "&format=vti").body)
        self.assertEqual(volume.fields["labels"], ["", "brick wall", "wood", "roof tiles", "leaves"])

    def test_files_of_one_array_have_that_of_the_npz_and_its_place(self):
        for query in (SURFACE, SOLID, BAND):
            for place in PLACES + ("&dtype=float32",):
                grid = self.npz(query + place)
                names = self.channels(grid)
                for form, read in ONE_ARRAY.items():
                    for name in names[-1:] if place else names:
                        volume = read(self.voxelize(f"{query}{place}&format={form}&channel={name}").body)
                        self.check_same(volume.arrays[name], self.expected(grid, name), (form, query, place, name))
                        self.check_place(volume, grid, 1e-6 if form == "nii" else 1e-12)
                    default = read(self.voxelize(f"{query}{place}&format={form}").body)
                    self.assertEqual(list(default.arrays), ["occupancy"])

    def test_nibabel_reads_the_arrays_and_the_place_of_a_nii(self):
        for query in (SURFACE, BAND):
            grid = self.npz(query)
            for name in self.channels(grid):
                data = self.voxelize(f"{query}&units=mm&format=nii&channel={name}").body
                image = nibabel.Nifti1Image.from_bytes(gzip.decompress(data))
                got = image.dataobj.get_unscaled()
                if got.dtype.names:
                    got = np.stack([got[component] for component in "RGBA"], -1)
                wanted = self.expected(grid, name)
                self.check_same(got.reshape(got.shape[:3] + got.shape[4:] if got.ndim == 5 else got.shape),
                                wanted.transpose(2, 1, 0, *range(3, wanted.ndim)), name)
                if name == "normal":
                    np.testing.assert_allclose(image.get_fdata()[..., 0, :], got[..., 0, :] / 127, atol=1e-7)
                centre = grid["origin"] + grid["voxel_size"] / 2
                affine = np.diag([*grid["voxel_size"], 1])
                affine[:3, 3] = centre
                for read in (image.affine, image.get_qform(), image.get_sform()):
                    np.testing.assert_allclose(read, affine, atol=1e-6)
                self.assertEqual(image.header.get_xyzt_units()[0], "mm")
                meta = json.loads(image.header.extensions[0].get_content())
                self.assertEqual(meta["dims"], list(image.shape[:3]))

    def test_teem_reads_the_samples_and_the_place_of_a_nrrd(self):
        grid = self.npz(SURFACE)
        with tempfile.TemporaryDirectory() as directory:
            source, copy = pathlib.Path(directory) / "a.nrrd", pathlib.Path(directory) / "b.nrrd"
            for name in self.channels(grid):
                source.write_bytes(self.voxelize(f"{SURFACE}&units=mm&format=nrrd&channel={name}").body)
                subprocess.run(["teem-unu", "save", "-f", "nrrd", "-e", "raw", "-i", source, "-o", copy], check=True,
                               capture_output=True)
                head, body = copy.read_bytes().split(b"\n\n", 1)
                self.assertEqual(body, grid[name].tobytes(), name)
                lines = dict(line.split(": ", 1) for line in head.decode().splitlines() if ": " in line)
                self.assertEqual(lines["space"], "3D-right-handed")
                self.assertEqual(lines["space units"], '"mm" "mm" "mm"')
                origin = [float(n) for n in lines["space origin"].strip("()").split(",")]
                np.testing.assert_allclose(origin, grid["origin"] + grid["voxel_size"] / 2, rtol=1e-9)
                meta = next(line for line in head.decode().splitlines() if line.startswith("meta:="))
                self.assertIn("voxel_size", meta)

    def test_meta_and_units_are_in_the_file_or_a_warning(self):
        grid = json.loads(bytes(self.npz("size=20&units=mm")["meta"]))
        for form, read in ONE_ARRAY.items():
            response = self.voxelize(f"size=20&units=mm&format={form}")
            self.assertEqual(response.headers["X-Voxeld-Warnings"], "lost-channels", form)
            volume = read(response.body)
            if form == "mha":
                self.assertEqual(volume.fields["DistanceUnits"], "mm")
            else:
                self.assertEqual(json.loads(volume.fields["meta"]), grid)
        self.assertEqual(volume.fields["units"], 2)
        lost = {"nrrd": None, "mha": "lost-units", "nii": "lost-units", "csv": "lost-units", "pcd": None,
                "binvox": "lost-channels, lost-units", "qb": "lost-units, lost-placement", "vti": None}
        for form, codes in lost.items():
            channel = "&channel=color" if form in ONE_ARRAY else ""
            response = self.voxelize(f"size=20&units=in&format={form}{channel}")
            self.assertEqual(response.headers.get("X-Voxeld-Warnings"), codes, form)
            self.assertEqual(response.headers["Content-Type"], MEDIA_TYPES[form])
        job = self.daemon.get("/v1/jobs/" + self.voxelize("size=20&format=binvox").headers["X-Voxeld-Job"]).json()
        self.assertIn({"code": "lost-channels", "detail": "binvox: no place for color"}, job["result"]["warnings"])

    def test_voxels_that_are_no_cubes_keep_their_sizes_or_give_a_warning(self):
        query = "dims=20,30,16&bounds=-1,-1,-1,1,3,1&channels=color,distance"
        grid = self.npz(query)
        response = self.voxelize(query + "&format=vti")
        volume = readers.read_vti(response.body)
        self.check_place(volume, grid)
        self.assertTrue((volume.arrays["distance"] == grid["distance"]).all())
        self.assertEqual(response.headers["X-Voxeld-Warnings"], "distance-in-voxels")
        response = self.voxelize(query + "&format=binvox")
        self.assertEqual(response.headers["X-Voxeld-Warnings"], "lost-channels, not-cubes")

    def test_a_binvox_has_the_occupied_cells_in_a_cube(self):
        for query in (SURFACE, "size=48&fill=solid&channels=occupancy", "dims=9,40,20"):
            for place in PLACES[:1] if "dims" in query else PLACES:
                grid = self.npz(query + place)
                volume = readers.read_binvox(self.voxelize(query + place + "&format=binvox").body)
                nz, ny, nx = grid["occupancy"].shape
                cube = volume.arrays["occupancy"]
                self.assertEqual(cube.shape, (max(nx, ny, nz),) * 3)
                self.assertTrue((cube[:nz, :ny, :nx] == grid["occupancy"]).all())
                self.assertEqual(cube.sum(), grid["occupancy"].sum())
                self.check_place(volume, grid)

    def check_points(self, grid, sparse, column, exact):
        """column(name): of the file; rows are those of the sparse arrays, in their order."""
        centres = (sparse["coords"] + 0.5) * grid["voxel_size"] + grid["origin"]
        for number, name in enumerate(("px", "py", "pz")):
            np.testing.assert_allclose(column(name), centres[:, number], rtol=0 if exact else 1e-6,
                                       atol=1e-12 if exact else 1e-6)
        if "normal" in grid.files:
            for number, name in enumerate(("nx", "ny", "nz")):
                wanted = sparse["normal"][:, number].astype(np.float32) / np.float32(127)
                self.assertTrue((column(name).astype(np.float32) == wanted).all())
        for name in ("material", "label"):
            if name in grid.files:
                self.assertTrue((column(name) == sparse[name]).all())
        if "distance" in grid.files:
            self.assertTrue((column("distance").astype(np.float32) == self.expected(sparse, "distance")).all())
        if "coverage" in grid.files:
            wanted = sparse["coverage"].astype(np.float32) / np.float32(255)
            self.assertTrue((column("coverage").astype(np.float32) == wanted).all())

    def test_points_are_the_rows_of_the_sparse_arrays(self):
        for query in (SURFACE, SOLID, BAND):
            for place in PLACES:
                grid, sparse = self.npz(query + place), self.npz(query + place + "&layout=sparse")
                table = readers.read_csv(self.voxelize(query + place + "&format=csv").body)
                for number, name in enumerate("xyz"):
                    self.assertTrue((table[name] == sparse["coords"][:, number]).all())
                self.check_points(grid, sparse, table.__getitem__, True)
                points, comments = readers.read_pcd(self.voxelize(query + place + "&format=pcd").body)
                names = {"px": "x", "py": "y", "pz": "z", "nx": "normal_x", "ny": "normal_y", "nz": "normal_z"}
                self.check_points(grid, sparse, lambda name: points[names.get(name, name)], False)
                self.assertIn("dims " + " ".join(map(str, grid["occupancy"].shape[::-1])), comments)
                if "color" not in grid.files:
                    continue
                for number, name in enumerate("rgba"):
                    self.assertTrue((table[name] == sparse["color"][:, number]).all())
                packed = points["rgb"].view(np.uint32)
                colored = sparse["color"][:, 3] > 0  # not inside
                wanted = sparse["color"][:, :3].astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
                self.assertTrue((packed[colored] == wanted[colored]).all())

    def check_qubicle(self, query):
        grid = self.npz(query)
        cells, colors = readers.read_qb(self.voxelize(query + "&format=qb").body)
        nz, ny, nx = grid["occupancy"].shape
        image = np.zeros((nz, ny, nx, 4), np.uint8)
        self.assertEqual(len(np.unique(cells, axis=0)), len(cells))
        image[cells[:, 2], cells[:, 1], cells[:, 0]] = colors
        self.assertTrue(((image[..., 3] == 255) == (grid["occupancy"] == 1)).all())
        colored = grid["color"][..., 3] > 0
        self.assertTrue((image[colored][:, :3] == grid["color"][colored][:, :3]).all())

    def test_a_qubicle_file_has_each_voxel_and_its_colour(self):
        for query in (SURFACE, SOLID, "size=300"):
            for place in PLACES:
                self.check_qubicle(query + place)

    def test_goxel_reads_the_voxels_of_a_qubicle_file(self):
        query = "size=300"
        dense = self.npz(query)
        with tempfile.TemporaryDirectory() as directory:
            source, text = pathlib.Path(directory) / "a.qb", pathlib.Path(directory) / "a.txt"
            source.write_bytes(self.voxelize(query + "&format=qb").body)
            subprocess.run(["xvfb-run", "-a", "goxel", source, "-e", text], check=True, capture_output=True,
                           timeout=300, env={**os.environ, "HOME": directory, "LIBGL_ALWAYS_SOFTWARE": "1"})
            rows = [line.split() for line in text.read_text().splitlines() if not line.startswith("#")]
        theirs = np.array([row[:3] for row in rows], int)
        z, y, x = np.nonzero(dense["occupancy"])
        colors = ["%02x%02x%02x" % tuple(color[:3]) for color in dense["color"][z, y, x]]
        # Its z is up, so it shows y as z; a mirrored grid would have other cells.
        ours = np.stack([x, -z, y], 1)
        ours, theirs = ours - ours.min(0), theirs - theirs.min(0)
        self.assertEqual({(*cell, color) for cell, color in zip(map(tuple, ours.tolist()), colors)},
                         {(*cell, row[3].lower()) for cell, row in zip(map(tuple, theirs.tolist()), rows)})

    def test_frames_are_a_zip_of_files(self):
        query = "animation=walk&size=24&channels=color,normal"
        frames = np.load(io.BytesIO(self.voxelize(query + "&format=npz", "worm.md5.zip").body))
        for form, read in {**ONE_ARRAY, "vti": readers.read_vti}.items():
            channel = "&channel=color" if form != "vti" else ""
            response = self.voxelize(f"{query}&format={form}{channel}", "worm.md5.zip")
            self.assertEqual(response.headers["Content-Type"], "application/zip")
            archive = zipfile.ZipFile(io.BytesIO(response.body))
            extension = "nii.gz" if form == "nii" else form
            self.assertEqual(archive.namelist(), [f"frame-{i:04}.{extension}" for i in range(6)])
            for index, name in enumerate(archive.namelist()):
                volume = read(archive.read(name))
                self.assertTrue((volume.arrays["color"] == frames["color"][index]).all())
                self.check_place(volume, frames, 1e-6 if form == "nii" else 1e-12)

    def test_a_region_of_a_frame_is_described_by_its_meta(self):
        response = self.voxelize("animation=walk&size=24&format=nrrd&region=0,0,0,8,9,10", "worm.md5.zip")
        archive = zipfile.ZipFile(io.BytesIO(response.body))
        self.assertEqual(len(archive.namelist()), 6)
        for name in archive.namelist():
            text = archive.read(name).split(b"\n\n")[0].decode()
            self.assertIn("\nsizes: 8 9 10\n", text)
            meta = json.loads(re.search(r"^meta:=(.*)$", text, re.MULTILINE)[1])
            self.assertEqual(meta["dims"], [8, 9, 10])

    def test_a_channel_that_the_grid_lacks_is_refused(self):
        def refused(response, expected, got):
            self.assertEqual(response.status, 400, response.body)
            problem = response.json()
            self.assertEqual((problem["code"], problem["detail"], problem["expected"], problem["got"]),
                             ("invalid-option", "channel", expected, got))

        mesh = self.fixture("sample.off")  # without colours
        post = lambda query: self.daemon.post("/v1/voxelize?filename=sample.off&size=9&" + query, mesh)  # noqa: E731
        refused(post("format=nrrd&channel=color"), "occupancy, which the grid has", '"color"')
        refused(post("format=nrrd&channel=label"), "channels with label", '"label"')
        refused(post("format=vti&channel=label"), "format nrrd, mha, nii, ktx2, raw or slices with it", '"vti"')
        grid = post("channels=label&format=native").headers["X-Voxeld-Grid"]
        for more in ("", "&level=1"):
            refused(self.daemon.get(f"/v1/grids/{grid}?format=mha&channel=normal{more}"),
                    "occupancy | label, which the grid has", '"normal"')
            made = self.daemon.get(f"/v1/grids/{grid}?format=mha&channel=label{more}")
            self.assertEqual(made.status, 200, made.body)

    def test_accept_names_a_format_and_the_channel_applies_to_it(self):
        body = self.fixture("sample.obj.zip")
        for form, kind in MEDIA_TYPES.items():
            response = self.daemon.request("POST", "/v1/voxelize?size=16&filename=sample.obj.zip", body,
                                           {"Accept": kind})
            self.assertEqual(response.status, 200, response.body)
            self.assertEqual(response.body, self.voxelize("size=16&format=" + form).body)
        response = self.daemon.request("POST", "/v1/voxelize?size=16&channel=color&filename=sample.obj.zip", body,
                                       {"Accept": MEDIA_TYPES["nii"]})
        self.assertEqual(list(readers.read_nii(response.body).arrays), ["color"])

    def test_equal_requests_give_equal_bytes(self):
        for form in MEDIA_TYPES:
            query = f"{SURFACE}&format={form}&cache=no"
            self.assertEqual(self.voxelize(query).body, self.voxelize(query).body, form)

    def test_grids_too_large_are_refused_before_they_are_computed(self):
        for form, dims, text in (("vti", "2048,1024,1025", "vti is dense: too many cells"),
                                 ("nii", "2048,1024,1025", "nii is dense: too many cells"),
                                 ("binvox", "1291,8,8", "binvox: too many cells in the cube around the grid, of side 1291")):
            response = self.daemon.post(f"/v1/voxelize?dims={dims}&format={form}&filename=sample.off",
                                        self.fixture("sample.off"))
            self.assertEqual(response.json()["code"], "grid-too-large", response.body)
            self.assertTrue(response.json()["detail"].startswith(text), response.body)


if __name__ == "__main__":
    unittest.main()
