"""Palettes, crop and mirror of grids and sequences, compared with numpy on the whole grid's arrays."""
import io
import json
import os
import pathlib
import re
import subprocess
import tempfile

import numpy as np

import python_package  # noqa: F401: makes voxeld known
from harness import BIN, DaemonTest
from minecraft_readers import oklab

import voxeld

CGA = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(16)]) * 170 + (np.arange(16) >= 8)[:, None] * 85
CGA[6] = (170, 85, 0)
THREE = np.array([[26, 28, 44], [244, 244, 244], [200, 60, 40]])
THREE_TEXT = ",".join(f"%23{r:02x}{g:02x}{b:02x}" for r, g, b in THREE)


def vox_palette(data):
    """The colours of a .vox, by the description of the format."""
    at = data.index(b"RGBA") + 12
    return np.frombuffer(data[at:at + 1020], np.uint8).reshape(-1, 4)[:, :3]


class Palettes(DaemonTest):
    device = "cpu"

    def get(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/voxelize?filename={name}&{query}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query, name="sample.glb"):
        return np.load(io.BytesIO(self.get(f"{query}&format=npz", name).body))

    def error(self, query):
        response = self.daemon.post(f"/v1/voxelize?filename=sample.glb&{query}", self.fixture("sample.glb"))
        self.assertEqual(response.status, 400, response.body)
        problem = json.loads(response.body)
        return problem["detail"], problem["expected"], problem["got"]

    def check_nearest(self, colors, got, palette):
        """Each colour became one of the nearest of the palette."""
        unique, where = np.unique(colors, axis=0, return_inverse=True)
        distances = np.linalg.norm(oklab(unique)[:, None] - oklab(palette)[None], axis=2)
        index = {tuple(color): number for number, color in enumerate(palette.tolist())}
        chosen = np.array([index[tuple(color)] for color in got.tolist()])
        own = distances[where.ravel(), chosen]
        np.testing.assert_allclose(own, distances.min(1)[where.ravel()], rtol=0, atol=1e-6)

    def test_each_voxel_has_the_nearest_colour_of_a_palette(self):
        whole = self.npz("size=60")
        for text, palette in (("cga16", CGA), (THREE_TEXT, THREE)):
            made = self.npz(f"size=60&palette={text}")
            np.testing.assert_array_equal(made["occupancy"], whole["occupancy"])
            np.testing.assert_array_equal(made["color"][..., 3], whole["color"][..., 3])
            colored = whole["color"][..., 3] > 0
            self.check_nearest(whole["color"][colored][:, :3], made["color"][colored][:, :3], palette)

    def test_arrays_of_colours_take_a_palette_in_a_query(self):
        for name in ("nrrd", "mha", "nii", "raw", "slices", "ktx2"):
            with self.subTest(name):
                self.get(f"size=10&format={name}&channel=color&palette=cga16")
        self.assertIn("palette", self.error("size=10&format=nrrd&palette=cga16")[0])

    def test_the_inside_of_a_solid_stays_and_has_no_colour(self):
        query = "size=60&fill=solid"
        whole, made = self.npz(query), self.npz(f"{query}&palette={THREE_TEXT}")
        inside = (whole["occupancy"] > 0) & (whole["color"] == 0).all(-1)
        self.assertTrue(inside.any())
        self.assertTrue((made["color"][inside] == 0).all())
        points = re.search(rb"POINTS (\d+)", self.get(f"{query}&palette={THREE_TEXT}&format=pcd").body)
        self.assertEqual(int(points[1]), int(whole["occupancy"].sum()))

    def test_a_vox_has_the_palette_in_its_order(self):
        palette = vox_palette(self.get(f"size=40&format=vox&palette={THREE_TEXT}").body)
        np.testing.assert_array_equal(palette[:3], THREE)
        palette = vox_palette(self.get("size=40&format=vox&palette=cga16&dither=bayer").body)
        np.testing.assert_array_equal(palette[:16], CGA)
        frames = self.get(f"size=24&animation=0&format=vox&palette={THREE_TEXT}", "spin.glb").body
        np.testing.assert_array_equal(vox_palette(frames)[:3], THREE)

    def test_dither_keeps_the_mean_colour(self):
        whole = self.npz("size=60")
        colored = whole["color"][..., 3] > 0
        mean = oklab(whole["color"][colored][:, :3]).mean(0)
        errors = {}
        for dither in ("none", "bayer", "error"):
            made = self.npz(f"size=60&palette=rgb8&dither={dither}")
            errors[dither] = np.linalg.norm(oklab(made["color"][colored][:, :3]).mean(0) - mean)
        self.assertLess(errors["bayer"], errors["none"])
        self.assertLess(errors["error"], errors["none"])

    def test_what_a_palette_cannot_do_is_refused(self):
        self.assertEqual(self.error("palette=cga17")[0], "palette")
        self.assertEqual(self.error("palette=bw&format=binvox"),
                         ("palette", "a format that holds colours with it", '"binvox"'))
        self.assertEqual(self.error("palette=bw&format=npz&color=none&size=20"),
                         ("palette: the grid has no colours", "channel color", "occupancy"))

    def test_mirror_reverses_the_arrays(self):
        whole = self.npz("size=70&channels=color,normal,label&labels=material")
        # Arrays have the axes z, y, x.
        for axes, flipped in (("x", 2), ("y", 1), ("x,z", (0, 2))):
            made = self.npz(f"size=70&channels=color,normal,label&labels=material&mirror={axes}")
            for name in ("occupancy", "color", "label"):
                np.testing.assert_array_equal(made[name], np.flip(whole[name], flipped), name)
            signs = np.array([-1 if axis in axes else 1 for axis in "xyz"])
            np.testing.assert_array_equal(made["normal"], np.flip(whole["normal"], flipped) * signs)
            np.testing.assert_array_equal(made["origin"], whole["origin"])

    def test_crop_is_the_box_of_the_voxels(self):
        whole = self.npz("size=70&padding=5")
        response = self.get("size=70&padding=5&crop=yes&format=npz")
        made = np.load(io.BytesIO(response.body))
        used = np.argwhere(whole["occupancy"])
        (z0, y0, x0), (z1, y1, x1) = used.min(0), used.max(0) + 1
        np.testing.assert_array_equal(made["occupancy"], whole["occupancy"][z0:z1, y0:y1, x0:x1])
        np.testing.assert_array_equal(made["color"], whole["color"][z0:z1, y0:y1, x0:x1])
        np.testing.assert_allclose(made["origin"], whole["origin"] + whole["voxel_size"] * (x0, y0, z0))
        meta = json.loads(response.headers["x-voxeld-meta"])
        self.assertEqual(meta["region"], [int(v) for v in (x0, y0, z0, x1, y1, z1)])

    def test_frames_have_the_box_of_all_frames(self):
        query = "size=40&animation=0&frames=0..5&padding=3"
        whole = self.npz(query, "spin.glb")["occupancy"]
        made = self.npz(query + "&crop=yes&mirror=y", "spin.glb")["occupancy"]
        used = np.argwhere(whole.any(0))
        (z0, y0, x0), (z1, y1, x1) = used.min(0), used.max(0) + 1
        np.testing.assert_array_equal(made, np.flip(whole[:, z0:z1, y0:y1, x0:x1], 2))

    def test_a_changed_grid_is_stored_and_exported(self):
        made = self.get("size=50&crop=yes&mirror=x&palette=bw")
        grid = made.headers["x-voxeld-grid"]
        stored = self.daemon.get(f"/v1/grids/{grid}?format=npz&mirror=x")
        self.assertEqual(stored.status, 200, stored.body)
        again = np.load(io.BytesIO(stored.body))
        plain = self.npz("size=50&crop=yes&palette=bw")
        np.testing.assert_array_equal(again["occupancy"], plain["occupancy"])
        np.testing.assert_array_equal(again["color"], plain["color"])

    def test_the_command_line_reads_palette_files(self):
        environment = {**os.environ, "VOXELD_URL": self.daemon.url}
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder)
            (path / "sample.glb").write_bytes(self.fixture("sample.glb"))
            (path / "three.gpl").write_text("GIMP Palette\n" + "".join(f"{r} {g} {b}\n" for r, g, b in THREE))
            (path / "wrong.gpl").write_text("GIMP Palette\n1 2\n")

            def voxel(palette):
                return subprocess.run([BIN / "voxel", path / "sample.glb", "-o", path / "a.vox", "--size", "30",
                                       "--palette", palette], capture_output=True, text=True, env=environment,
                                      timeout=120, stdin=subprocess.DEVNULL)

            done = voxel(path / "three.gpl")
            self.assertEqual(done.returncode, 0, done.stderr)
            np.testing.assert_array_equal(vox_palette((path / "a.vox").read_bytes())[:3], THREE)
            refused = voxel(path / "wrong.gpl")
            self.assertEqual(refused.returncode, 2)
            self.assertIn("wrong.gpl line 2: expected red, green and blue from 0 to 255, got \"1 2\"",
                          refused.stderr)

    def test_python_reads_palette_files(self):
        with tempfile.TemporaryDirectory() as folder, voxeld.Client(self.daemon.url) as client:
            path = pathlib.Path(folder)
            (path / "sample.glb").write_bytes(self.fixture("sample.glb"))
            (path / "three.hex").write_text("".join(f"{r:02x}{g:02x}{b:02x}\n" for r, g, b in THREE))
            (path / "wrong.hex").write_text("12345\n")
            grid = client.voxelize(path / "sample.glb", size=30, crop=True, mirror="x")
            for palette in (path / "three.hex", ["#1a1c2c", "#f4f4f4", "#c83c28"], "#1a1c2c,#f4f4f4,#c83c28"):
                grid.save(path / "a.vox", palette=palette)
                np.testing.assert_array_equal(vox_palette((path / "a.vox").read_bytes())[:3], THREE)
            with self.assertRaisesRegex(voxeld.Error, "wrong.hex line 1: expected six hexadecimal digits"):
                grid.save(path / "a.vox", palette=path / "wrong.hex")
