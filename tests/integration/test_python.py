"""The Python package against the real daemon: meshes in, arrays, files and images out."""
import asyncio
import concurrent.futures
import contextlib
import functools
import importlib
import importlib.util
import io
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tracemalloc
import unittest
import unittest.mock
import zipfile

import numpy as np

import python_package
from harness import HANG_SECONDS, DaemonTest, wait_until

import voxeld
from voxeld import _call, _client, _decode, _mesh, _references, _transport, aio

ALL_CHANNELS = ["color", "normal", "material", "label", "distance", "coverage"]
LONG = {"size": 16384, "channels": "occupancy", "cache": False}  # of sheets.obj: longer than a test on any machine
MOMENTS = {"times": [k / 4096 for k in range(4096)], "size": 600, "cache": False}  # of spin.glb: likewise
CUBE = (np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64),
        np.array([[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3], [0, 4, 6],
                  [0, 6, 2], [1, 3, 7], [1, 7, 5]]))


def paths_of(mesh):
    return list(_references.referenced_files(mesh))


def png_size(data):
    assert data.startswith(b"\x89PNG\r\n\x1a\n"), data[:16]
    return struct.unpack(">II", data[16:24])


class PythonTest(DaemonTest):
    device = "cpu"

    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.dir = pathlib.Path(directory.name)
        self.client = voxeld.Client(self.daemon.url)
        self.addCleanup(self.client.close)
        self.sample = self.fixtures / "sample.ply"
        self.sheets = self.fixtures / "sheets.obj"

    def npz(self, path):
        response = self.daemon.get(path)
        self.assertEqual(response.status, 200, response.body)
        return np.load(io.BytesIO(response.body))

    def states(self):
        """kind and state of each job, newest first."""
        return [(job["kind"], job["state"]) for job in self.daemon.get("/v1/jobs?limit=1000").json()["jobs"]]

    def job_state(self, job):
        return self.daemon.wait(job)["state"]

    def problem(self, kind, code, *parts, of):
        """Checks the exception that `of` raises, and returns it."""
        with self.assertRaises(kind) as raised:
            of()
        self.assertEqual(raised.exception.code, code)
        for part in parts:
            self.assertIn(part, str(raised.exception))
        return raised.exception


class Grids(PythonTest):
    def assert_rows_are_those_of_the_daemon(self, grid, query=""):
        sparse = self.npz(f"/v1/grids/{grid.id}?format=npz&layout=sparse{query}")
        dense = self.npz(f"/v1/grids/{grid.id}?format=npz{query}")
        np.testing.assert_array_equal(grid.coords, sparse["coords"])
        self.assertEqual(grid.coords.dtype, np.int32)
        self.assertEqual(grid.voxel_count, len(sparse["coords"]))
        self.assertEqual(grid.dims, tuple(sparse["dims"]))
        np.testing.assert_array_equal(grid.origin, sparse["origin"])
        np.testing.assert_array_equal(grid.voxel_size, sparse["voxel_size"])
        np.testing.assert_array_equal(grid.occupancy, dense["occupancy"])
        self.assertEqual((grid.occupancy.dtype, grid.occupancy.shape), (np.bool_, grid.shape))
        for channel in ALL_CHANNELS:
            self.assertEqual(channel in grid.channels, channel in sparse)
            if channel in sparse:
                np.testing.assert_array_equal(grid.rows(channel), sparse[channel], channel)
                self.assertEqual(grid.rows(channel).dtype, sparse[channel].dtype)
                x, y, z = grid.coords.T
                np.testing.assert_array_equal(grid.dense(channel)[z, y, x], sparse[channel])
            else:
                self.assertIsNone(grid.rows(channel))

    def test_every_channel_of_every_fill_is_that_of_the_daemon_with_and_without_the_decoder(self):
        self.assertTrue(voxeld.has_decoder())
        for fill in ("surface", "solid", "shell", "band"):
            channels = [each for each in ALL_CHANNELS if each != "coverage" or fill in ("surface", "solid")]
            thickness = 2 if fill in ("shell", "band") else None
            grid = self.client.voxelize(self.sample, size=80, fill=fill, channels=channels, thickness=thickness)
            with self.subTest(fill):
                self.assert_rows_are_those_of_the_daemon(grid)
                with unittest.mock.patch.object(_decode, "library", lambda: None):
                    again = self.client.grid(grid.id).fetch()
                self.assertIsInstance(again._decoded, _decode.SparseArrays)
                self.assert_rows_are_those_of_the_daemon(again)

    def test_a_grid_has_arrays_facts_and_meta(self):
        grid = self.client.voxelize(self.sample, size=40, channels=["color", "normal"])
        count = grid.voxel_count
        self.assertEqual((len(grid), grid.coords.shape, grid.colors.shape, grid.normals.shape),
                         (count, (count, 3), (count, 4), (count, 3)))
        self.assertEqual(grid.channels, ("color", "normal"))
        self.assertEqual(max(grid.dims), 40)
        self.assertEqual(grid.meta["voxel_count"], count)
        self.assertEqual(grid.normals.dtype, np.float32)
        np.testing.assert_allclose(np.linalg.norm(grid.normals, axis=1), 1, atol=0.01)
        np.testing.assert_array_equal(grid.points, grid.origin + (grid.coords + 0.5) * grid.voxel_size)
        self.assertIsNone(grid.labels)
        self.assertEqual(repr(grid), f"<voxeld.Grid of {' x '.join(map(str, grid.dims))} cells, {count} voxels: "
                                     "color, normal>")
        plain = self.client.voxelize(self.sample, size=40, channels="occupancy")
        self.assertEqual(repr(plain), f"<voxeld.Grid of {' x '.join(map(str, grid.dims))} cells, {count} voxels>")
        self.assertIs(grid.coords, grid.coords)
        refused = self.problem(voxeld.BadInput, "invalid-option", "color, normal", of=lambda: grid.dense("label"))
        self.assertEqual(refused.got, "label")
        self.problem(voxeld.BadInput, "invalid-option", "colour", of=lambda: grid.rows("colour"))

    def test_facts_and_files_need_no_download_of_the_grid(self):
        grid = self.client.voxelize(self.sample, size=32)
        with unittest.mock.patch.object(self.client, "_decoded", side_effect=AssertionError):
            self.assertGreater(grid.voxel_count * min(grid.dims) * len(grid.channels), 0)
            grid.save(self.dir / "a.vox")
        self.assertTrue((self.dir / "a.vox").read_bytes().startswith(b"VOX "))

    def test_parts_of_a_grid_are_those_of_the_daemon(self):
        grid = self.client.voxelize(self.sample, size=64, channels=["color"])
        self.assert_rows_are_those_of_the_daemon(grid.level(2), "&level=2&level_rule=any")
        self.assert_rows_are_those_of_the_daemon(grid.level(1, "majority"), "&level=1&level_rule=majority")
        first, end = (4, 8, 0), (36, 28, 16)
        part = grid.region(first, end)
        self.assert_rows_are_those_of_the_daemon(part, "&region=4,8,0,36,28,16")
        self.assertEqual(part.dims, (32, 20, 16))
        both = grid.region(first, end).level(1)
        self.assert_rows_are_those_of_the_daemon(both, "&region=4,8,0,36,28,16&level=1&level_rule=any")
        self.problem(voxeld.BadInput, "invalid-option", "a second level", of=lambda: grid.level(1).level(1))
        # The daemon takes a region of the stored grid's cells, and changes what it has taken.
        self.problem(voxeld.BadInput, "invalid-option", "one with level", of=lambda: grid.level(1).region(first, end))
        for change in ({"mirror": "y"}, {"erode": 1}):
            frame = next(iter(self.client.animate(self.fixtures / "spin.glb", fps=1, size=16, **change)))
            for part in (functools.partial(frame.region, first, end), functools.partial(frame.level, 1)):
                self.problem(voxeld.BadInput, "invalid-option", f"one with {next(iter(change))}", of=part)
        grid.level(2).save(self.dir / "coarse.npz")
        self.assertEqual(np.load(self.dir / "coarse.npz")["occupancy"].shape, grid.level(2).shape)

    def test_threads_that_write_to_one_file_write_it_whole(self):
        path = self.dir / "latest.png"

        def save(value):
            for _ in range(25):
                voxeld.Image(bytes([value]) * 200_000).save(path)
                data = path.read_bytes()
                self.assertEqual(data, data[:1] * 200_000)
        with concurrent.futures.ThreadPoolExecutor(4) as threads:
            list(threads.map(save, range(4)))
        self.assertEqual([each.name for each in self.dir.glob(".*")], [])

    def test_the_extension_chooses_the_format_of_a_file(self):
        grid = self.client.voxelize(self.sample, size=24)
        for extension, magic in {".voxg": b"VOXGRID\0", ".npy": b"\x93NUMPY", ".npz": b"PK\3\4", ".vox": b"VOX ",
                                 ".png": b"\x89PNG", ".gif": b"GIF8", ".PNG": b"\x89PNG"}.items():
            path = self.dir / ("a" + extension)
            grid.save(path, **({"turntable": 3, "width": 16, "height": 16} if extension == ".gif" else {}))
            self.assertTrue(path.read_bytes().startswith(magic), extension)
        grid.save(str(self.dir / "a.xyz"))
        self.assertEqual(len((self.dir / "a.xyz").read_text().splitlines()), len(grid))
        for mesh, start in (("a.glb", b"glTF"), ("a.ply", b"ply\n"), ("a.obj", b"#")):
            grid.save(self.dir / mesh, mesh="faces")
            self.assertEqual((self.dir / mesh).read_bytes()[:len(start)], start)
        for name, start in (("a.vti", b"<?xml"), ("a.nrrd", b"NRRD0004\n"), ("a.mha", b"ObjectType"),
                            ("a.b.NII.GZ", b"\x1f\x8b"), ("a.binvox", b"#binvox 1\n"), ("a.csv", b"x,y,z,px"),
                            ("a.pcd", b"# .PCD v0.7"), ("a.qb", b"\1\1\0\0")):
            grid.save(self.dir / name)
            self.assertEqual((self.dir / name).read_bytes()[:len(start)], start)
        grid.save(self.dir / "color.mha", channel="color")
        self.assertIn(b"ElementNumberOfChannels = 4\n", (self.dir / "color.mha").read_bytes())
        self.problem(voxeld.BadInput, "invalid-option", "channel", "occupancy | color, which the grid has", "normal",
                     of=lambda: grid.save(self.dir / "a.mha", channel="normal"))
        for name in ("a.schem", "a.litematic", "a.nbt"):
            grid.save(self.dir / name, blocks=["concrete", "minecraft:stone"], dither="bayer")
            self.assertEqual((self.dir / name).read_bytes()[:2], b"\x1f\x8b")
        grid.save(self.dir / "b.npz", layout="sparse")
        np.testing.assert_array_equal(np.load(self.dir / "b.npz")["coords"], grid.coords)
        self.assertEqual((self.dir / "a.voxg").read_bytes(), self.daemon.get(f"/v1/grids/{grid.id}").body)
        self.assertEqual([path.name for path in self.dir.iterdir() if path.name.startswith(".")], [])
        self.problem(voxeld.BadInput, "file",
                     ".voxg .npy .npz .vox .xyz .glb .ply .obj .vti .nrrd .mha .nii.gz .binvox .csv .pcd .qb "
                     ".schem .litematic .nbt .zarr.zip .vdb .nvdb .bt .ldr .vtu .inp .ktx2 .raw.zip .slices.zip .png",
                     "'.stl'", of=lambda: grid.save(self.dir / "a.stl"))
        self.problem(voxeld.BadInput, "file", "format=vox by its extension",
                     of=lambda: grid.save("a.vox", format="npy"))
        self.problem(voxeld.BadInput, "file", "No such file", of=lambda: grid.save(self.dir / "none/a.vox"))
        grid.save(self.dir / "any.bin", format="npy")
        self.assertTrue((self.dir / "any.bin").read_bytes().startswith(b"\x93NUMPY"))

    def test_images_are_bytes_that_a_notebook_shows(self):
        grid = self.client.voxelize(self.sample, size=32)
        image = grid.render(azimuth=30, width=96, height=64, occlusion=False)
        self.assertIsInstance(image, bytes)
        self.assertEqual((png_size(image), image.media_type), ((96, 64), "image/png"))
        self.assertEqual(image._repr_png_(), bytes(image))
        self.assertNotEqual(image, grid.render(azimuth=120, width=96, height=64, occlusion=False))
        self.assertEqual(png_size(grid._repr_png_()), (512, 512))
        around = grid.render(image="gif", turntable=3, width=32, height=32)
        self.assertEqual((around[:4], around.media_type), (b"GIF8", "image/gif"))
        self.assertIsNone(around._repr_png_())
        self.assertIn("data:image/gif;base64,R0lG", around._repr_html_())
        around.save(self.dir / "around.gif")
        self.assertEqual((self.dir / "around.gif").read_bytes(), around)
        (self.dir / "link.gif").symlink_to(self.dir / "around.gif")
        with unittest.mock.patch.object(os, "replace", side_effect=OSError(28, "No space left on device")):
            self.problem(voxeld.BadInput, "file", "No space", of=lambda: image.save(self.dir / "link.gif"))
        self.assertEqual((self.dir / "around.gif").read_bytes(), around)
        image.save(self.dir / "link.gif")
        self.assertTrue((self.dir / "link.gif").is_symlink())
        self.assertEqual((self.dir / "around.gif").read_bytes(), image)
        self.problem(voxeld.BadInput, "file", "none.gpl: No such file", of=lambda: grid.save(
            self.dir / "a.vox", palette=self.dir / "none.gpl"))
        direct = self.client.render(self.sample, size=32, azimuth=30, width=96, height=64, occlusion=False)
        self.assertEqual(direct, image)

    def test_a_stored_grid_is_found_by_its_id_until_it_is_deleted(self):
        grid = self.client.voxelize(self.sample, size=20, rule="thin")
        again = self.client.grid(grid.id)
        self.assertEqual(repr(again), f"<voxeld.Grid {grid.id[:19]}…>")
        np.testing.assert_array_equal(again.coords, grid.coords)
        self.assertEqual((again.dims, again.voxel_count, again.channels), (grid.dims, len(grid), grid.channels))
        self.client.delete(grid)
        gone = self.problem(voxeld.NotFound, "gone", of=lambda: self.client.grid(grid.id).coords)
        self.assertEqual(gone.status, 410)
        np.testing.assert_array_equal(again.coords, grid.coords)


class Meshes(PythonTest):
    def requests_of(self, work):
        """(method, path without query) of the requests that `work` makes."""
        asked = []
        real = _transport.Transport._exchange

        def exchange(transport, call, method, path, *rest):
            asked.append((method, path.partition("?")[0]))
            return real(transport, call, method, path, *rest)
        with unittest.mock.patch.object(_transport.Transport, "_exchange", exchange):
            work()
        return asked

    def test_arrays_give_the_voxels_of_the_same_file(self):
        vertices, faces = CUBE
        path = self.dir / "cube.off"
        path.write_text(f"OFF\n{len(vertices)} {len(faces)} 0\n" + "".join(
            " ".join(map(str, row)) + "\n" for row in [*vertices.tolist(), *([3, *face] for face in faces.tolist())]))
        from_file = self.client.voxelize(path, size=24, fill="solid")
        for arrays in ((vertices, faces), (vertices.astype(np.float32), faces.astype(np.uint8)),
                       (vertices.tolist(), faces.tolist()), (vertices.astype(int), faces)):
            grid = self.client.voxelize(arrays, size=24, fill="solid")
            np.testing.assert_array_equal(grid.coords, from_file.coords)
        self.assertEqual(len(from_file), 24 ** 3)

    def test_quads_are_faces(self):
        quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
        np.testing.assert_array_equal(self.client.voxelize((CUBE[0], quads), size=12, fill="solid").coords,
                                      self.client.voxelize(CUBE, size=12, fill="solid").coords)

    def test_colors_are_bytes_or_fractions_with_or_without_alpha(self):
        for colors, expected in ((np.array([[10, 200, 30]] * 8, np.uint8), [10, 200, 30, 255]),
                                 (np.array([[0.2, 1, 0]] * 8), [51, 255, 0, 255]),
                                 (np.array([[255, 0, 0, 128]] * 8), [255, 0, 0, 128])):
            grid = self.client.voxelize((*CUBE, colors), size=8)
            self.assertEqual(np.unique(grid.colors, axis=0).tolist(), [expected])

    def test_arrays_that_are_no_mesh_are_refused_before_anything_is_sent(self):
        vertices, faces = CUBE
        table = [
            ((vertices[:, :2], faces), "vertices: expected numbers of shape (N, 3), got float64 of shape (8, 2)"),
            ((vertices, faces[:, :2]), "faces: expected integers of shape (M, 3) or (M, 4), got int64 of shape "
                                       "(12, 2)"),
            ((vertices, faces.astype(float)), "faces: expected integers of shape (M, 3) or (M, 4), got float64 of "
                                              "shape (12, 3)"),
            ((vertices, faces + 1), "faces: expected indices 0 to 7, got 1 to 8"),
            ((vertices, faces, np.zeros((7, 3))), "colors: expected numbers of shape (8, 3) or (8, 4), got float64 of "
                                                  "shape (7, 3)"),
            ((vertices, faces, np.full((8, 3), 2.0)), "colors of float64: expected 0 to 1, got 2.0 to 2.0"),
            ((vertices, faces, np.full((8, 3), 256)), "colors of int64: expected 0 to 255, got 256 to 256"),
            (7, "a mesh of type int: expected a path"),
            (io.StringIO("v 0 0 0"), "a mesh: expected a file that is open in binary mode, got str from its read()"),
            (self.dir / "none.ply", "none.ply: No such file or directory"),
        ]
        for mesh, text in table:
            asked = self.requests_of(lambda mesh=mesh, text=text: self.problem(
                voxeld.BadInput, "file", text, of=lambda: self.client.voxelize(mesh)))
            self.assertEqual(asked, [])

    def test_objects_of_other_libraries_are_meshes(self):
        class Visual:
            kind = "vertex"
            vertex_colors = np.array([[1, 2, 3, 255]] * 8, np.uint8)

        class Trimesh:
            vertices, faces = CUBE
            visual = Visual()

        class Open3d:
            vertices, triangles = CUBE
            vertex_colors = np.array([[0, 1, 0]] * 8, float)

        for mesh, color in ((Trimesh(), [1, 2, 3, 255]), (Open3d(), [0, 255, 0, 255])):
            grid = self.client.voxelize(mesh, size=8)
            self.assertEqual(np.unique(grid.colors, axis=0).tolist(), [color])

        class FaceVisual:
            kind = "face"
            face_colors = np.array([[0, 0, 255, 255]] * 2 + [[255, 0, 0, 255]] * 10, np.uint8)
        Trimesh.visual = FaceVisual()
        colors = self.client.voxelize(Trimesh(), size=8, color="nearest").dense("color")
        # The first two triangles of the cube are those at z = 0.
        self.assertEqual(colors[0, 4, 4].tolist(), [0, 0, 255, 255])
        self.assertEqual(colors[7, 4, 4].tolist(), [255, 0, 0, 255])

    def test_bytes_and_open_files_are_meshes(self):
        data = self.sample.read_bytes()
        expected = self.client.voxelize(self.sample, size=16).id
        self.assertEqual(self.client.voxelize(data, size=16).id, expected)
        self.assertEqual(self.client.voxelize(io.BytesIO(data), size=16).id, expected)
        with open(self.sample, "rb") as file:
            self.assertEqual(self.client.voxelize(file, size=16).id, expected)
        self.assertEqual(self.client.voxelize(data, size=16, filename="a.ply").id, expected)
        refused = self.problem(voxeld.BadInput, "malformed-mesh", of=lambda: self.client.voxelize(
            b"ply\nnonsense", size=16, filename="a.ply"))
        self.assertEqual((refused.status, refused.job[:2]), (422, "j-"))

    def test_a_file_that_the_server_has_is_not_sent_again(self):
        path = self.dir / "big.ply"
        path.write_bytes(self.sample.read_bytes() + b"\n" * 65536)
        sent = ("POST", "/v1/assets")
        self.assertIn(sent, self.requests_of(lambda: self.client.voxelize(path, size=16)))
        self.assertNotIn(sent, self.requests_of(lambda: self.client.voxelize(path, size=18)))
        # Under another name the bytes are another mesh.
        other = self.dir / "big.off"
        shutil.copy(path, other)
        self.assertIn(sent, self.requests_of(lambda: self.client.upload(other)))

    def test_a_known_file_that_is_deleted_meanwhile_is_sent(self):
        path = self.dir / "big.ply"
        path.write_bytes(self.sample.read_bytes() + b"\n" * 65537)
        real = voxeld.Client._known_asset

        def known(client, call, file):
            found = real(client, call, file)
            self.client.delete(asset)
            return found
        with open(path, "rb") as file:
            for size, mesh in ((17, path), (18, file)):  # a file is at its end after it was read
                asset = self.client.upload(path)
                with unittest.mock.patch.object(voxeld.Client, "_known_asset", known):
                    self.assertGreater(len(self.client.voxelize(mesh, size=size)), 0)

    def test_files_that_an_obj_names_are_sent_with_it(self):
        (self.dir / "textures").mkdir()
        shutil.copy(self.fixtures / "sample.ply", self.dir / "unrelated.ply")
        image = self.client.render(CUBE, size=2, width=4, height=4, background="#ff0000")
        (self.dir / "textures" / "red wood.png").write_bytes(image)
        (self.dir / "a.mtl").write_text("newmtl wood\nmap_Kd -s 1 1 1 textures/red wood.png # comment\n"
                                        f"newmtl secret\nmap_Kd ../{self.dir.name}-secret.png\n")
        (self.dir / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl wood\n"
                                        "f 1/1 2/2 3/3\nusemtl secret\nf 1/1 3/3 2/2\n")
        (self.dir.parent / f"{self.dir.name}-secret.png").write_bytes(image)
        self.addCleanup((self.dir.parent / f"{self.dir.name}-secret.png").unlink)
        info = self.client.info(self.dir / "a.obj")
        self.assertEqual((info["triangles"], [each["name"] for each in info["missing_files"]]),
                         (2, [f"../{self.dir.name}-secret.png"]))
        grid = self.client.voxelize(self.dir / "a.obj", size=8)
        self.assertIn("color", grid.channels)
        self.assertTrue(any("-secret.png" in each for each in grid.warnings), grid.warnings)
        (self.dir / "a.mtl").unlink()
        self.assertEqual([each["name"] for each in self.client.info(self.dir / "a.obj")["missing_files"]], ["a.mtl"])

    def test_files_that_cannot_be_read_or_are_empty_are_left_out(self):
        (self.dir / "loop.mtl").symlink_to("loop.mtl")
        (self.dir / "a.mtl").write_text("map_Kd skin.png\nmap_Kd empty.png\n")
        (self.dir / "skin.png").write_bytes(b"x")
        (self.dir / "skin.png").chmod(0)
        (self.dir / "empty.png").touch()
        (self.dir / "a.obj").write_text("mtllib loop.mtl\nmtllib a.mtl\n")
        files = ["a.mtl"] + ["skin.png"] * (os.geteuid() == 0)  # root reads every file
        self.assertEqual(paths_of(self.dir / "a.obj"), files)

    def test_an_md5mesh_of_a_folder_that_cannot_be_listed_is_sent_alone(self):
        with unittest.mock.patch.object(pathlib.Path, "iterdir", side_effect=PermissionError):
            self.assertEqual(paths_of(self.fixtures / "worm/worm.md5mesh"), [])

    def test_the_libraries_of_an_obj_are_found_without_reading_its_other_lines(self):
        (self.dir / "a.mtl").write_text("newmtl m\n")
        path = self.dir / "a.obj"
        for text, is_found in ((b"v 0 0 0\r\n \tmtllib\ta.mtl # c\r\n", True), (b"#\rmtllib a.mtl\r", True),
                               (b"\xef\xbb\xbfmtllib a.mtl", True), ("mtllib a.mtl\n".encode("utf-16"), True),
                               ("mtllib a.mtl\n".encode("utf-16") + b"a", True),
                               (b"# mtllib a.mtl\n", False), (b"xmtllib a.mtl\n", False)):
            path.write_bytes(text)
            self.assertEqual(paths_of(path), ["a.mtl"] * is_found, text)
        path.write_bytes(b"mtllib a.mtl\n" + b"v 0.25 0.5 0.75\n" * 200_000)
        tracemalloc.start()
        self.addCleanup(tracemalloc.stop)
        self.assertEqual(paths_of(path), ["a.mtl"])
        self.assertLess(tracemalloc.get_traced_memory()[1], 2 * path.stat().st_size)

    def test_a_gltf_of_countless_brackets_is_sent_as_it_is(self):
        path = self.dir / "deep.gltf"
        path.write_text("[" * 100_000)
        self.problem(voxeld.BadInput, "malformed-mesh", "depth", of=lambda: self.client.voxelize(path, size=8))

    def test_a_mesh_that_names_itself_is_sent_once(self):
        for name, text in (("a.obj", "mtllib a.obj\n"), ("a.gltf", '{"buffers": [{"uri": "a.gltf"}]}')):
            (self.dir / name).write_text(text)
            self.assertEqual([file.name for file in _mesh.files_of(self.dir / name, "")], [name])

    def test_files_under_other_names_are_sent_and_found(self):
        (self.dir / "textures").mkdir()
        image = self.client.render(CUBE, size=2, width=4, height=4, background="#ff0000")
        for name in ("textures/brick.png", "\u8d34\u56fe.png", "u\u0308.png", "scan_0.png"):
            (self.dir / name).write_bytes(image)
        (self.dir / "wall.mtl").write_bytes(b"newmtl a\nmap_Kd C:\\me\\Textures\\BRICK.PNG\nnewmtl b\nmap_Kd "
                                            + "\u8d34\u56fe.png\n".encode("gbk")
                                            + "newmtl c\nmap_Kd \u00fc.png\n".encode())
        (self.dir / "wall.obj").write_text("mtllib Wall.MTL\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\n"
                                           "f 1/1 2/1 3/1\nusemtl b\nf 1/1 3/1 2/1\nusemtl c\nf 2/1 3/1 1/1\n")
        (self.dir / "scan.ply").write_text(
            "ply\nformat ascii 1.0\ncomment TextureFile <this>_0.png\nelement vertex 3\nproperty float x\n"
            "property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n"
            "property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n")
        for name in ("wall.obj", "scan.ply"):
            self.assertEqual(self.client.info(self.dir / name)["missing_files"], [], name)
        warnings = self.client.voxelize(self.dir / "wall.obj", size=8).warnings
        self.assertEqual(len([each for each in warnings if "is taken for it" in each]), 4, warnings)

    def test_names_on_disk_that_are_not_utf8_or_have_backslashes_are_found(self):
        image = self.client.render(CUBE, size=2, width=4, height=4, background="#ff0000")
        (self.dir / os.fsdecode(b"K\xf6rper.mtl")).write_bytes(b"newmtl m\nmap_Kd tex\\skin.png\n")
        (self.dir / "tex\\skin.png").write_bytes(image)
        (self.dir / "a.obj").write_bytes(b"mtllib K\xf6rper.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\n"
                                         b"f 1/1 2/1 3/1\n")
        self.assertEqual(self.client.info(self.dir / "a.obj")["missing_files"], [])

    def test_a_file_is_sent_under_the_reading_of_its_name_that_was_found(self):
        gbk = os.fsdecode("\u8d34\u56fe.png".encode("gbk"))
        (self.dir / "tex").mkdir()
        (self.dir / "tex" / gbk).write_bytes(self.client.render(CUBE, size=2, width=4, height=4))
        (self.dir / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
        cp437, unicode = "tex/\u2560\u2219\u2550\u255d.png", "tex/\u8d34\u56fe.png"
        for textures, name in (("D:\\x\\\u8d34\u56fe.png", unicode), (gbk, cp437),
                               (f"tex/{gbk}\nmap_Kd \u8d34\u56fe.PNG", unicode)):
            (self.dir / "a.mtl").write_bytes(os.fsencode(f"newmtl m\nmap_Kd {textures}\n"))
            self.assertEqual(_references.referenced_files(self.dir / "a.obj"), {"a.mtl": "a.mtl", f"tex/{gbk}": name})
            self.assertEqual(self.client.info(self.dir / "a.obj")["missing_files"], [], textures)

    def test_files_whose_names_no_bundle_may_have_are_left_out(self):
        deep = "d" * 200 + "/" + "n" * 100
        for path in ("d" * 200, os.fsdecode(b"\x95\x5c")):
            (self.dir / path).mkdir()
        names = (deep, "a:b.png", "1:b.png", "a\x01.png", "..\\x.png", os.fsdecode(b"\x95\x5c/y.png"), "z.png")
        for name in names:
            (self.dir / name).write_bytes(b"x")
        (self.dir / "a.mtl").write_bytes(b"".join(b"map_Kd " + os.fsencode(name) + b"\n" for name in names))
        (self.dir / "1:m.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        self.assertEqual([file.name for file in _mesh.files_of(self.dir / "1:m.obj", "")],
                         ["mesh.obj", "a.mtl", "\u00f2/y.png", "z.png"])
        self.assertEqual(self.client.info(self.dir / "1:m.obj")["triangles"], 1)
        self.problem(voxeld.BadInput, "file", "1:b.png: no file of a bundle may have this name",
                     of=lambda: self.client.info([self.sample, self.dir / "1:b.png"]))

    def test_a_missing_file_is_searched_in_each_encoding_only_where_a_name_is_no_utf8(self):
        path = self.dir / "a.obj"
        for text, searches_max in ((b"mtllib none.mtl\n", 4), (b"mtllib n\xf6ne.mtl\n", 24)):
            path.write_bytes(text)
            with unittest.mock.patch.object(_references, "_find", wraps=_references._find) as find:
                self.assertEqual(paths_of(path), [])
            self.assertLessEqual(find.call_count, searches_max)

    def test_animations_beside_an_md5mesh_are_sent_with_it(self):
        info = self.client.info(self.fixtures / "worm/worm.md5mesh")
        self.assertEqual(sorted(each["name"] for each in info["animations"]), ["walk", "wave"])
        for path in (self.fixtures / "worm").iterdir():
            if path.suffix != ".md5anim":
                shutil.copy(path, self.dir)
        self.assertEqual(self.client.info(self.dir / "worm.md5mesh")["animations"], [])
        given = [self.dir / "worm.md5mesh", self.fixtures / "worm/walk.md5anim"]
        self.assertEqual([each["name"] for each in self.client.info(given)["animations"]], ["walk"])
        self.problem(voxeld.BadInput, "file", "need different names", of=lambda: self.client.info([*given, given[0]]))
        (self.dir / "empty.md5anim").touch()
        self.assertEqual(self.client.info(self.dir / "worm.md5mesh")["animations"], [])
        given[1] = self.dir / "empty.md5anim"
        self.problem(voxeld.BadInput, "file", "empty.md5anim: is empty", of=lambda: self.client.info(given))

    def test_an_asset_stands_for_its_mesh(self):
        asset = self.client.upload(self.sample)
        self.assertEqual(self.client.voxelize(asset, size=16).id, self.client.voxelize(self.sample, size=16).id)
        estimate = self.client.estimate(asset, size=512)
        self.assertLessEqual(estimate["seconds_low"], estimate["seconds_high"])
        self.client.delete(asset)
        self.problem(voxeld.NotFound, "gone", of=lambda: self.client.voxelize(asset, size=19))


class Animations(PythonTest):
    def test_frames_are_those_of_the_daemon(self):
        frames = list(self.client.animate(self.fixtures / "spin.glb", animation=0, fps=4, size=24))
        self.assertEqual([frame.index for frame in frames], list(range(len(frames))))
        self.assertEqual([frame.time for frame in frames], [index / 4 for index in range(len(frames))])
        self.assertGreater(len(frames), 3)
        for frame in frames:
            own = self.npz(f"/v1/jobs/{frame.job}/frames/{frame.index}?format=npz&layout=sparse")
            np.testing.assert_array_equal(frame.coords, own["coords"])
            np.testing.assert_array_equal(frame.colors, own["color"])
            self.assertEqual(frame.voxel_count, len(own["coords"]))
        self.assertEqual(len({frame.dims for frame in frames}), 1)
        self.assertEqual(png_size(frames[1].render(width=32, height=32)), (32, 32))

    def test_a_frame_is_given_before_the_last_one_is_done(self):
        animation = self.client.animate(self.fixtures / "spin.glb", **MOMENTS)
        frames = iter(animation)
        first = next(frames)
        self.assertEqual((first.index, self.daemon.get(f"/v1/jobs/{animation.job}").json()["state"]), (0, "running"))
        frames.close()
        self.assertEqual(self.job_state(animation.job), "cancelled")

    def test_frames_and_times_choose_the_moments(self):
        animation = self.client.animate(self.fixtures / "spin.glb", frames=range(1, 4), fps=8, size=16)
        self.assertEqual([round(frame.time, 6) for frame in animation], [0.125, 0.25, 0.375])
        timed = self.client.animate(self.fixtures / "spin.glb", times=np.array([0.1, 0.3]), size=16)
        self.assertEqual([round(frame.time, 6) for frame in timed], [0.1, 0.3])
        still = self.client.voxelize(self.fixtures / "spin.glb", animation=0, time=0.25, size=16)
        self.assertGreater(len(still), 0)
        self.problem(voxeld.BadInput, "invalid-option", "animate()", of=lambda: self.client.voxelize(
            self.fixtures / "spin.glb", animation=0, time=None))
        self.problem(voxeld.BadInput, "invalid-option", "voxelize()", of=lambda: self.client.animate(
            self.fixtures / "spin.glb", time=0.25))

    def test_what_changes_voxels_is_in_frames_and_in_files(self):
        animation = self.client.animate(self.fixtures / "spin.glb", fps=4, size=16, mirror="x", level=1)
        frames = list(animation)
        own = self.npz(f"/v1/grids/{frames[1].id}?format=npz&layout=sparse&mirror=x&level=1")
        np.testing.assert_array_equal(frames[1].coords, own["coords"])
        animation.save(self.dir / "half.npy")
        self.assertEqual(np.load(self.dir / "half.npy").shape[1:], frames[1].dims[::-1])
        cropped = self.client.animate(self.fixtures / "spin.glb", fps=4, size=16, padding=4, crop=True)
        self.problem(voxeld.BadInput, "invalid-option", "crop", of=lambda: list(cropped))
        for of in (frames[1].render, animation.render, functools.partial(animation.save, self.dir / "a.gif")):
            self.problem(voxeld.BadInput, "invalid-option", "mirror", of=of)
        self.assertIsNone(frames[1]._repr_png_())
        self.assertEqual(cropped.render(width=16, height=16).media_type, "image/gif")
        cropped.save(self.dir / "box.npy")
        self.assertLess(max(np.load(self.dir / "box.npy").shape[1:]), 16)

    def test_an_animation_is_saved_and_rendered_as_a_whole(self):
        animation = self.client.animate(self.fixtures / "spin.glb", fps=4, size=16)
        for extension, magic in {".voxs": b"VOXSEQ\0", ".vox": b"VOX ", ".npz": b"PK\3\4", ".zip": b"PK\3\4",
                                 ".gif": b"GIF8"}.items():
            animation.save(self.dir / ("a" + extension))
            self.assertTrue((self.dir / ("a" + extension)).read_bytes().startswith(magic), extension)
        self.assertEqual(np.load(self.dir / "a.npz")["occupancy"].shape[0], animation.meta["frames"])
        self.assertEqual(animation.render(width=16, height=16).media_type, "image/gif")
        self.assertEqual(png_size(animation.render(image="png", frame=1, width=16, height=16)), (16, 16))
        self.assertEqual(animation.warnings, [])
        self.problem(voxeld.BadInput, "file", ".voxs", of=lambda: animation.save(self.dir / "a.voxg"))
        animation.save(self.dir / "meshes.zip", format="ply")
        names = zipfile.ZipFile(self.dir / "meshes.zip").namelist()
        self.assertTrue(names and all(name.endswith(".ply") for name in names), names)
        self.problem(voxeld.BadInput, "file",
                     "format=xyz or glb or ply or obj or vti or nrrd or mha or nii or binvox or csv or pcd or qb or "
                     "schem or litematic or nbt or vdb or nvdb or bt or ldr or vtu or inp or ktx2 or raw or slices",
                     of=lambda: animation.save(self.dir / "a.zip", format="npy"))

    def test_a_frame_is_deleted_with_its_animation_alone(self):
        animation = self.client.animate(self.fixtures / "spin.glb", fps=4, size=17)
        frames = list(animation)
        self.problem(voxeld.Error, "conflict", "is a frame", of=lambda: self.client.delete(frames[1]))
        for part in (frames[1].level(1), frames[1].region((0, 0, 0), (4, 4, 4))):
            self.problem(voxeld.BadInput, "invalid-option", "a part", of=lambda: self.client.delete(part))
        self.assertEqual([frame.id for frame in animation], [frame.id for frame in frames])
        self.client.delete(animation)
        self.problem(voxeld.NotFound, "gone", of=lambda: frames[1].coords)

    def test_the_error_of_the_job_is_raised(self):
        self.problem(voxeld.Error, "invalid-option", of=lambda: list(self.client.animate(
            self.fixtures / "spin.glb", animation="nod", size=16)))


class TileStreams(PythonTest):
    arguments = ("--part-seconds", "0")

    def test_tiles_of_a_running_job_are_the_grid(self):
        stream = self.client.voxelize_tiles(self.sample, size=900, channels=["color"], cache=False)
        parts = []
        for tiles in stream:
            self.assertEqual(tiles.first_tile == 0, not parts)
            self.assertIsInstance(tiles, voxeld.Tiles)
            parts.append(tiles)
        grid = stream.grid()
        np.testing.assert_array_equal(np.concatenate([part.coords for part in parts]), grid.coords)
        np.testing.assert_array_equal(np.concatenate([part.colors for part in parts]), grid.colors)
        np.testing.assert_array_equal(np.concatenate([part.points for part in parts]), grid.points)
        self.assertEqual({part.dims for part in parts}, {grid.dims})
        self.assertRegex(repr(parts[0]), r"<voxeld.Tiles of \d+ x \d+ x \d+ cells, \d+ voxels: color>")

    def test_a_loop_that_is_left_cancels_the_job_and_its_error_is_raised(self):
        stream = self.client.voxelize_tiles(self.sheets, **LONG)
        for _ in stream:
            self.assertEqual(self.daemon.get(f"/v1/jobs/{stream.job}").json()["state"], "running")
            break
        self.assertEqual(self.job_state(stream.job), "cancelled")
        self.problem(voxeld.Error, "cancelled", of=lambda: list(stream))
        self.problem(voxeld.Error, "invalid-option", "makes one grid",
                     of=lambda: self.client.voxelize_tiles(self.sample, animation=0))


class CallsTest(PythonTest):
    def running(self):
        """The id of the newest job, once it runs."""
        def newest():
            jobs = self.daemon.get("/v1/jobs?limit=1").json()["jobs"]
            return jobs[0]["id"] if jobs and jobs[0]["state"] == "running" else None
        return wait_until(newest, "a job runs")

    def cancel_by_token(self):
        """Seconds from the cancel of a call whose job runs to its end."""
        token = voxeld.CancelToken()
        raised = []

        def work():
            try:
                self.client.voxelize(self.sheets, cancel=token, **LONG)
            except voxeld.Error as failure:
                raised.append(failure)
        thread = threading.Thread(target=work)
        thread.start()
        job = self.running()
        start = time.monotonic()
        token.cancel()
        thread.join(HANG_SECONDS)
        self.assertFalse(thread.is_alive())
        seconds = time.monotonic() - start
        self.assertEqual([type(each) for each in raised], [voxeld.Cancelled])
        self.assertEqual(self.job_state(job), "cancelled")
        self.problem(voxeld.Cancelled, "interrupted", of=lambda: self.client.voxelize(self.sample, cancel=token))
        return seconds


class Calls(CallsTest):
    def test_a_problem_is_an_exception_with_its_members(self):
        refused = self.problem(voxeld.BadInput, "invalid-option", of=lambda: self.client.voxelize(
            self.sample, size=99999))
        self.assertEqual((refused.status, refused.detail, refused.type),
                         (400, "size", "urn:voxeld:error:invalid-option"))
        self.assertIn("from 1 to 16384", refused.expected)
        self.assertEqual(refused.problem["code"], "invalid-option")
        self.assertTrue(refused.request_id.startswith("r-") and refused.title)
        self.assertIsInstance(refused, ValueError)
        for value, text in ((range(0, 9, 2), "frames: expected a range of step 1 that is not empty, got range(0, 9"),
                            (1j, "frames: expected a text, a number, a bool or a list of them, got complex 1j")):
            self.problem(voxeld.BadInput, "invalid-option", text, of=lambda value=value: self.client.animate(
                self.sample, frames=value))
        self.problem(voxeld.BadInput, "unknown-option", "siez", of=lambda: self.client.voxelize(self.sample, siez=3))
        failed = self.problem(voxeld.BadInput, "malformed-mesh", "line 4", of=lambda: self.client.voxelize(
            self.fixtures / "bad/index.obj"))
        self.assertEqual(self.daemon.get(f"/v1/jobs/{failed.job}").json()["state"], "failed")
        self.assertEqual(str(type(failed)), "<class 'voxeld.BadInput'>")

    def test_a_token_cancels_a_call_and_its_job(self):
        self.cancel_by_token()

    def test_a_timeout_cancels_the_job(self):
        calls = []

        def spied(*arguments):
            calls.append(_call.Call(*arguments))
            return calls[-1]

        def end_when_it_runs(progress):
            if progress.stage not in ("hash", "upload", "queued"):
                calls[0].deadline = time.monotonic()
        with unittest.mock.patch.object(_client, "Call", spied):
            late = self.problem(voxeld.Timeout, "timeout", "longer than 3600 s", of=lambda: self.client.voxelize(
                self.sheets, timeout=3600, progress=end_when_it_runs, **LONG))
        self.assertIsInstance(late, TimeoutError)
        self.assertEqual(self.job_state(self.daemon.get("/v1/jobs?limit=1").json()["jobs"][0]["id"]), "cancelled")

    def test_ctrl_c_cancels_the_job(self):
        script = ("import sys, voxeld\n"
                  f"voxeld.Client({self.daemon.url!r}).voxelize(sys.argv[1], size=16384, cache=False)\n")
        process = subprocess.Popen([sys.executable, "-c", script, self.sheets], stderr=subprocess.PIPE,
                                   env={**os.environ, **python_package.ENVIRONMENT})
        job = self.running()
        process.send_signal(signal.SIGINT)
        error = process.communicate(timeout=HANG_SECONDS)[1]
        self.assertIn(b"KeyboardInterrupt", error)
        self.assertEqual(self.job_state(job), "cancelled")

    def test_an_exception_of_the_progress_callback_cancels_the_job(self):
        seen = []

        def report(progress):
            seen.append(progress)
            if progress.stage not in ("hash", "upload", "queued"):
                raise ZeroDivisionError
        with self.assertRaises(ZeroDivisionError):
            self.client.voxelize(self.sheets, progress=report, **LONG)
        self.assertEqual(self.job_state(self.daemon.get("/v1/jobs?limit=1").json()["jobs"][0]["id"]), "cancelled")
        self.assertTrue(all(isinstance(each, voxeld.Progress) for each in seen))

    def test_progress_counts_bytes_tiles_and_frames(self):
        stages = {}
        path = self.dir / "big.obj"
        path.write_bytes(self.sheets.read_bytes() + b"\n" * 3_000_000)

        def report(progress):
            stages.setdefault(progress.unit, []).append(progress)
            if progress.unit == "tiles" and progress.total > 0:
                raise ZeroDivisionError
        with self.assertRaises(ZeroDivisionError):
            self.client.voxelize(path, progress=report, **LONG)
        self.assertEqual(stages["bytes"][-1].done, path.stat().st_size)
        self.assertLessEqual({one.stage for one in stages["bytes"]}, {"hash", "upload"})
        frames = []
        list(self.client.animate(self.fixtures / "spin.glb", fps=4, size=16, cache=False, progress=frames.append))
        self.assertEqual((frames[-1].unit, frames[-1].done), ("frames", frames[-1].total))

    def test_a_bar_shows_the_progress_of_calls_that_take_long(self):
        if importlib.util.find_spec("tqdm") is None:
            self.skipTest("tqdm is not installed")
        for seconds, expected in ((0, self.assertIn), (1e9, self.assertNotIn)):
            shown = io.StringIO()
            with unittest.mock.patch.object(_call, "BAR_SECONDS", seconds), contextlib.redirect_stderr(shown):
                self.client.voxelize(self.sample, size=16, progress=True)
                with contextlib.closing(_call.ProgressBar()) as bar:
                    bar(voxeld.Progress("voxelize", 1, 4, "tiles"))  # a call may see no stage of a job that ends soon
            for part in ("hash", "voxelize", "1/4"):
                expected(part, shown.getvalue())
        shown = io.StringIO()
        with unittest.mock.patch.object(_call, "BAR_SECONDS", 0), contextlib.redirect_stderr(shown):
            self.client.voxelize(self.sample, size=16, cache=False)  # no terminal
        self.assertEqual(shown.getvalue(), "")
        with unittest.mock.patch.dict(sys.modules, {"tqdm": None}), self.assertRaises(ImportError):
            self.client.voxelize(self.sample, size=16, progress=True)

    def test_threads_and_forks_share_a_client(self):
        sizes = list(range(8, 20))
        expected = {size: len(self.client.voxelize(self.sample, size=size).coords) for size in sizes}
        found = {}

        def work(size):
            found[size] = len(self.client.voxelize(self.sample, size=size).coords)
        threads = [threading.Thread(target=work, args=(size,)) for size in sizes]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(found, expected)
        children = []
        for size in sizes[:4]:
            child = os.fork()
            if child == 0:
                count = -1
                try:
                    count = len(self.client.voxelize(self.sample, size=size).coords)
                finally:
                    os._exit(0 if count == expected[size] else 1)
            children.append(child)
        self.assertEqual([os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children], [0] * 4)
        self.assertGreater(len(self.client.voxelize(self.sample, size=21)), 0)


class AsyncTest(PythonTest):
    def cancelled(self, start):
        """Runs a coroutine function, cancels it when a job runs, and returns the job's state at its end and the seconds
        until the call ended."""
        async def work():
            client = aio.AsyncClient(self.daemon.url)
            task = asyncio.ensure_future(start(client))
            while not (jobs := self.daemon.get("/v1/jobs?state=running").json()["jobs"]):
                await asyncio.sleep(0.02)
            begin = time.monotonic()
            task.cancel()
            with self.assertRaises(asyncio.CancelledError):
                await task
            return jobs[0]["id"], time.monotonic() - begin
        job, seconds = asyncio.run(asyncio.wait_for(work(), HANG_SECONDS))
        return self.job_state(job), seconds

    def cancelled_voxelize(self):
        return self.cancelled(lambda client: client.voxelize(self.sheets, **LONG))

    def cancelled_animate(self):
        async def frames(client):
            async for _ in client.animate(self.fixtures / "spin.glb", **MOMENTS):
                pass
        return self.cancelled(frames)


class Async(AsyncTest):
    def test_calls_run_side_by_side(self):
        async def work():
            async with aio.AsyncClient(self.daemon.url) as client:
                grids = await asyncio.gather(*(client.voxelize(self.sample, size=size) for size in (12, 14, 16)))
                await client.save(grids[0], self.dir / "a.vox")
                image = await client.render(grids[0], width=16, height=16)
                other = await client.render(self.sample, size=12, width=16, height=16)
                asset = await client.upload(self.sample)
                info = await client.info(asset)
                frames = [frame async for frame in client.animate(self.fixtures / "spin.glb", fps=4, size=16)]
                return grids, image, other, info, frames
        grids, image, other, info, frames = asyncio.run(work())
        for grid, size in zip(grids, (12, 14, 16)):
            self.assertIn("_decoded", grid.__dict__)
            np.testing.assert_array_equal(grid.coords, self.client.voxelize(self.sample, size=size).coords)
        self.assertTrue((self.dir / "a.vox").read_bytes().startswith(b"VOX "))
        self.assertEqual((png_size(image), image), ((16, 16), other))
        self.assertGreater(info["triangles"], 0)
        self.assertGreater(len(frames), 3)
        self.assertEqual([frame.index for frame in frames], list(range(len(frames))))
        self.assertTrue(all("_decoded" in frame.__dict__ for frame in frames))

    def test_a_cancelled_task_cancels_its_job(self):
        self.assertEqual(self.cancelled_voxelize()[0], "cancelled")
        self.assertEqual(self.cancelled_animate()[0], "cancelled")

    def test_errors_are_those_of_the_client(self):
        async def work():
            await aio.AsyncClient(self.daemon.url).voxelize(self.sample, size=-1)
        self.problem(voxeld.BadInput, "invalid-option", of=lambda: asyncio.run(work()))


class Conversions(PythonTest):
    def imported(self, name):
        if importlib.util.find_spec(name) is None:
            self.skipTest(f"{name} is not installed")
        return importlib.import_module(name)

    def grid(self):
        return self.client.voxelize(self.sample, size=24, channels=["color", "normal", "material"])

    def test_open3d(self):
        open3d = self.imported("open3d")
        grid = self.grid()
        voxels = grid.to_open3d()
        self.assertIsInstance(voxels, open3d.geometry.VoxelGrid)
        cells = {tuple(voxel.grid_index) for voxel in voxels.get_voxels()}
        self.assertEqual(cells, set(map(tuple, grid.coords.tolist())))
        points = grid.to_open3d("points")
        np.testing.assert_allclose(np.asarray(points.points), grid.points)
        np.testing.assert_allclose(np.asarray(points.colors), grid.colors[:, :3] / 255)
        self.assertTrue(points.has_normals())

    def test_trimesh(self):
        trimesh = self.imported("trimesh")
        grid = self.grid()
        voxels = grid.to_trimesh()
        self.assertIsInstance(voxels, trimesh.voxel.VoxelGrid)
        np.testing.assert_array_equal(voxels.matrix, grid.occupancy.transpose(2, 1, 0))
        key = np.lexsort(grid.points.T)
        np.testing.assert_allclose(voxels.points[np.lexsort(voxels.points.T)], grid.points[key])
        box = trimesh.creation.box()
        self.assertEqual(len(self.client.voxelize(box, size=8, fill="solid")), 8 ** 3)

    def test_pyvista(self):
        self.imported("pyvista")
        grid = self.grid()
        image = grid.to_pyvista()
        np.testing.assert_array_equal(image.cell_data["occupancy"].reshape(grid.shape), grid.occupancy)
        np.testing.assert_array_equal(image.cell_data["color"][image.cell_data["occupancy"] == 1].sum(0),
                                      grid.colors.sum(0))
        np.testing.assert_allclose(image.bounds[::2], grid.origin)

    def test_torch(self):
        torch = self.imported("torch")
        grid = self.grid()
        tensor = grid.to_torch_sparse()
        self.assertEqual((tuple(tensor.shape), tensor.dtype), (grid.shape, torch.float32))
        np.testing.assert_array_equal(tensor.to_dense().numpy() == 1, grid.occupancy)
        colors = grid.to_torch_sparse("color").to_dense().numpy()
        np.testing.assert_allclose(colors, grid.dense("color") / np.float32(255), atol=1e-6)

    def test_what_each_library_gets(self):
        """With recorders in place of the libraries, which few machines have."""
        grid = self.grid()
        for name in ("open3d", "trimesh", "pyvista", "torch"):
            library = unittest.mock.MagicMock()
            library.sparse_coo_tensor.return_value.coalesce.return_value = "tensor"
            with unittest.mock.patch.dict(sys.modules, {name: library}):
                if name == "open3d":
                    grid.to_open3d()
                    make = library.geometry.VoxelGrid.create_from_point_cloud_within_bounds
                    _, size, low, high = make.call_args.args
                    self.assertEqual(size, grid.voxel_size[0])
                    np.testing.assert_allclose(high - low, grid.voxel_size * grid.dims)
                elif name == "trimesh":
                    grid.to_trimesh()
                    made = library.voxel.encoding.SparseBinaryEncoding.call_args
                    self.assertEqual(made.kwargs, {"shape": grid.dims})
                    transform = library.voxel.VoxelGrid.call_args.kwargs["transform"]
                    np.testing.assert_allclose(transform @ [*grid.coords[5], 1], [*grid.points[5], 1])
                elif name == "pyvista":
                    library.ImageData.return_value.cell_data = cells = {}
                    grid.to_pyvista()
                    self.assertEqual(library.ImageData.call_args.kwargs["dimensions"].tolist(),
                                     [cell + 1 for cell in grid.dims])
                    self.assertEqual(sorted(cells), ["color", "material", "normal", "occupancy"])
                    self.assertEqual(cells["color"].shape, (int(np.prod(grid.dims)), 4))
                else:
                    library.from_numpy = np.asarray
                    self.assertEqual(grid.to_torch_sparse("normal"), "tensor")
                    cells, values, shape = library.sparse_coo_tensor.call_args.args
                    np.testing.assert_array_equal(cells, grid.coords[:, ::-1].T)
                    np.testing.assert_allclose(values, grid.normals)
                    self.assertEqual(shape, (*grid.shape, 3))


if __name__ == "__main__":
    unittest.main()
