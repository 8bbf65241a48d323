"""Files of voxels as input: grids that were written as .vox, .binvox, .npy, .nrrd or containers come back as they were."""
import io
import json
import pathlib
import struct
import subprocess
import tempfile
import unittest

import numpy as np

from harness import BIN, DaemonTest

SURFACE = "size=61&channels=color"


def with_meta(container, meta):
    """A container with another meta; proto/README.md has the byte map."""
    def padded(size):
        return -(-size // 8) * 8
    text = json.dumps(meta).encode()
    channels, (tiles, old) = struct.unpack_from("<I", container, 12)[0], struct.unpack_from("<II", container, 80)
    moved = padded(len(text)) - padded(old)
    head, rest = bytearray(container[:128]), bytearray(container[128 + padded(old):])
    struct.pack_into("<I", head, 84, len(text))
    struct.pack_into("<Q", head, 96, len(container) + moved)
    for tile in range(tiles):
        at = tile * padded(36 + 4 * bin(channels).count("1")) + 24
        struct.pack_into("<Q", rest, at, struct.unpack_from("<Q", rest, at)[0] + moved)
    return bytes(head) + text.ljust(padded(len(text)), b"\0") + bytes(rest)


class VolumeInputs(DaemonTest):
    device = "cpu"

    def post(self, query, body, name):
        return self.daemon.post(f"/v1/voxelize?{query}&filename={name}", body)

    def made(self, query, body, name):
        response = self.post(query, body, name)
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query, body, name):
        return np.load(io.BytesIO(self.made(query + "&format=npz", body, name).body))

    def meta(self, query, body, name):
        job = self.made(query, body, name).headers["X-Voxeld-Job"]
        return self.daemon.get(f"/v1/jobs/{job}").json()["result"]["meta"]

    def sample(self, query):
        return self.made(query, self.fixture("sample.glb"), "sample.glb").body

    def test_a_container_comes_back_with_all_channels(self):
        query = "size=50&channels=color,normal,label&labels=material"
        whole = self.sample(query)
        self.assertEqual(self.meta("", whole, "a.voxg")["source_format"], "voxg")
        first = np.load(io.BytesIO(self.sample(query + "&format=npz")))
        second = self.npz("", whole, "a.voxg")
        self.assertEqual(sorted(first.files), sorted(second.files))
        for name in set(first.files) - {"meta"}:
            np.testing.assert_array_equal(second[name], first[name], name)

    def test_a_container_of_a_band_keeps_which_side_is_inside(self):
        query = "size=64&fill=band"
        whole = self.sample(query)
        for more in ("", "&distance=world"):
            first = np.load(io.BytesIO(self.sample(query + more + "&format=npz")))
            second = self.npz("", self.sample(query + more), "a.voxg")
            np.testing.assert_array_equal(second["distance"], first["distance"])
            self.assertTrue((first["distance"][first["occupancy"] == 0] < 0).any())
        for more in ("&format=vdb", "&format=ply&mesh=smooth"):
            direct = self.sample(query + more)
            again = self.made(more[1:], whole, "a.voxg").body
            if more == "&format=vdb":
                self.assertIn(b"level set", again)
            else:
                vertices = [body[body.index(b"element vertex"):].split(b"\n")[0] for body in (direct, again)]
                self.assertEqual(vertices[0], vertices[1])

    def test_units_of_a_container_that_no_file_can_hold_are_left_out(self):
        whole = self.sample("size=8&color=none")
        for units in ("m" * 70000, "m\nelement vertex 9", 5, ["m"]):
            container = with_meta(whole, {"units": units})
            for form in ("schem", "ply", "nrrd"):
                self.made(f"format={form}", container, "a.voxg")
            self.assertEqual(self.meta("", container, "a.voxg")["units"], "")
        self.assertEqual(self.meta("", with_meta(whole, {"units": "um"}), "a.voxg")["units"], "um")

    def test_voxels_colors_and_places_come_back(self):
        first = np.load(io.BytesIO(self.sample(SURFACE + "&format=npz")))
        for form, more, has_place, has_color in (("vox", "&palette=255", True, False), ("binvox", "", True, False),
                                                 ("npy", "", False, False), ("nrrd", "", True, False),
                                                 ("nrrd", "&channel=color", True, True)):
            with self.subTest(form + more):
                file = self.sample(f"{SURFACE}&format={form}{more}")
                again = self.npz("", file, "a." + form)
                cells = first["occupancy"]
                found = again["occupancy"]
                if form == "binvox":  # a cube of the longest side
                    found = found[tuple(slice(n) for n in cells.shape)]
                    self.assertEqual(found.sum(), again["occupancy"].sum())
                np.testing.assert_array_equal(found, cells)
                if has_place:
                    np.testing.assert_allclose(again["origin"], first["origin"], rtol=1e-5, atol=1e-6)
                    np.testing.assert_allclose(again["voxel_size"], first["voxel_size"], rtol=1e-5)
                if has_color:
                    np.testing.assert_array_equal(again["color"], first["color"])
        few = self.sample(SURFACE + "&format=vox&palette=cga16")
        expected = np.load(io.BytesIO(self.sample(SURFACE + "&format=npz&palette=cga16")))
        np.testing.assert_array_equal(self.npz("", few, "a.vox")["color"], expected["color"])

    def test_one_format_becomes_another_and_options_of_files_apply(self):
        vox = self.sample(SURFACE + "&format=vox&palette=16")
        whole = self.npz("", vox, "a.vox")["occupancy"]
        self.assertTrue(self.made("format=schem", vox, "a.vox").body.startswith(b"\x1f\x8b"))
        np.testing.assert_array_equal(self.npz("mirror=x", vox, "a.vox")["occupancy"], whole[:, :, ::-1])
        np.testing.assert_array_equal(self.npz("region=3,4,5,20,30,35", vox, "a.vox")["occupancy"],
                                      whole[5:35, 4:30, 3:20])
        self.assertEqual(self.npz("level=1", vox, "a.vox")["occupancy"].shape[0], (whole.shape[0] + 1) // 2)

    def test_the_threshold_decides_what_a_voxel_is(self):
        values = np.random.default_rng(19).normal(size=(9, 17, 70)).astype("<f4")
        values[0, 0, 0] = np.nan
        file = io.BytesIO()
        np.save(file, values)
        for query, least in (("", 0.5), ("threshold=-0.25", -0.25), ("threshold=2", 2)):
            found = self.npz(query, file.getvalue(), "a.npy")
            np.testing.assert_array_equal(found["occupancy"], values >= np.float32(least))
            self.assertEqual(self.meta(query, file.getvalue(), "a.npy")["options"], {"threshold": least})

    def test_an_image_a_description_and_a_stored_grid(self):
        vox = self.sample(SURFACE + "&format=vox&palette=16")
        asset = self.daemon.post("/v1/assets?filename=a.vox", vox).json()["id"]
        described = self.daemon.get(f"/v1/assets/{asset}").json()
        whole = self.npz("", vox, "a.vox")["occupancy"]
        self.assertEqual((described["format"], described["triangles"]), ("vox", 0))
        self.assertEqual(described["voxels"]["dims"], list(whole.shape[::-1]))
        self.assertEqual(described["voxels"]["voxel_count"], int(whole.sum()))
        self.assertEqual(described["voxels"]["channels"], ["occupancy", "color"])
        status = self.daemon.wait(self.daemon.submit(kind="render", asset=asset, options={"width": 64, "height": 64}))
        self.assertEqual(status["state"], "done", status)
        image = self.daemon.get(f"/v1/jobs/{status['id']}/result").body
        self.assertTrue(image.startswith(b"\x89PNG"))
        by_grid = self.daemon.get(f"/v1/grids/{status['result']['grid']}/render.png?width=64&height=64")
        self.assertEqual(by_grid.body, image)

    def test_options_of_meshes_are_refused_or_named(self):
        vox = self.sample(SURFACE + "&format=vox&palette=16")
        response = self.made("size=20&fill=solid", vox, "a.vox")
        self.assertEqual(json.loads(response.headers["X-Voxeld-Meta"])["voxel_count"],
                         int(self.npz("", vox, "a.vox")["occupancy"].sum()))
        self.assertIn("unused-options", response.headers["X-Voxeld-Warnings"])
        self.assert_problem(self.post("animation=0", vox, "a.vox"), 400, "invalid-option", "animation", "voxels")
        self.assert_problem(self.post("variant=0", vox, "a.vox"), 400, "invalid-option", "variant", "voxels")
        self.assert_problem(self.post("format=nrrd&channel=normal", vox, "a.vox"), 400, "invalid-option", "channel")
        self.assert_problem(self.post("", vox[:200], "a.vox"), 422, "malformed-mesh", "a.vox")

    def test_the_command_line_converts(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder)
            (path / "a.vox").write_bytes(self.sample(SURFACE + "&format=vox&palette=16"))

            def voxel(*arguments):
                done = subprocess.run([BIN / "voxel", *arguments, "--url", self.daemon.url], cwd=path,
                                      capture_output=True, text=True, timeout=120)
                self.assertEqual(done.returncode, 0, done.stderr)
                return done.stdout
            for name, magic in (("b.schem", b"\x1f\x8b"), ("b.nrrd", b"NRRD"), ("b.glb", b"glTF"), ("b.vdb", b" BDV")):
                voxel("a.vox", "-o", name)
                self.assertTrue((path / name).read_bytes().startswith(magic), name)
            told = voxel("info", "a.vox")
            self.assertRegex(told, r"format +vox\n")
            self.assertRegex(told, r"cells +\d+ x \d+ x \d+\n")
            self.assertNotIn("triangles", told)


if __name__ == "__main__":
    unittest.main()
