"""3D textures, raw arrays and PNG slices, by numpy, teem, zstandard and PIL, against the npz of the same grid."""
import io
import json
import pathlib
import re
import struct
import subprocess
import tempfile
import unittest
import zipfile

import numpy as np
import zstandard
from PIL import Image

from harness import DaemonTest

SURFACE = "size=61&channels=color,normal,label&labels=material"
SOLID = "size=48&fill=solid&channels=color,material,coverage"
BAND = "size=40&fill=band"
PLACES = ("", "&level=1", "&region=10,5,3,36,17,18", "&region=10,5,3,36,17,18&level=1")
MEDIA_TYPES = {"ktx2": "image/ktx2", "raw": "application/x-raw+zip", "slices": "application/x-png-slices+zip"}
NRRD_TYPES = {"uint8": "u1", "int8": "i1", "uint16": "<u2", "float": "<f4"}
VK_TYPES = {9: ("u1", 1), 43: ("u1", 4), 38: ("i1", 4), 74: ("<u2", 1), 100: ("<f4", 1)}


def members(data):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def read_raw(data):
    """The array and the fields of the header."""
    files = members(data)
    assert list(files) == ["grid.nhdr", "grid.raw"], list(files)
    fields = dict(re.match(r"([^:]+):[= ](.*)", line).groups()
                  for line in files["grid.nhdr"].decode().splitlines()[2:])
    assert (fields["encoding"], fields["data file"]) == ("raw", "grid.raw")
    sizes = [int(size) for size in fields["sizes"].split()]
    samples = np.frombuffer(files["grid.raw"], NRRD_TYPES[fields["type"]])
    return samples.reshape(*sizes[:-4:-1], *sizes[:-3]), fields


def read_ktx2(data):
    """The texels [z, y, x] and the text values."""
    assert data[:12] == b"\xabKTX 20\xbb\r\n\x1a\n"
    vk_format, _, nx, ny, nz, layers, faces, levels, scheme = struct.unpack_from("<9I", data, 12)
    assert (layers, faces, levels, scheme) == (0, 1, 1, 2)
    _, _, at, length = struct.unpack_from("<4I", data, 48)
    values, end = {}, at + length
    while at < end:
        size, = struct.unpack_from("<I", data, at)
        key, value = data[at + 4:at + 4 + size].split(b"\0", 1)
        values[key.decode()] = value.rstrip(b"\0").decode()
        at += 4 + (size + 3) // 4 * 4
    begin, size, raw_size = struct.unpack_from("<3Q", data, 80)
    assert begin + size == len(data)
    raw = zstandard.ZstdDecompressor().decompress(data[begin:])
    assert len(raw) == raw_size
    dtype, samples = VK_TYPES[vk_format]
    shape = (nz, ny, nx) + ((samples,) if samples > 1 else ())
    return np.frombuffer(raw, dtype).reshape(shape), values


def read_png(data):
    image = Image.open(io.BytesIO(data))
    image.load()
    return image


def pixels_of(images):
    return np.stack([np.asarray(image) for image in images])


class Images3d(DaemonTest):
    def voxelize(self, query, name="sample.obj.zip"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz").body))

    def channels(self, grid):
        return [name for name in grid.files if name not in ("origin", "voxel_size", "meta")]

    def world(self, grid, name):
        """The array of the npz; distances become world units."""
        if name != "distance":
            return grid[name]
        return (grid["distance"].astype(float) * grid["voxel_size"][0]).astype(np.float32)

    def check_same(self, got, wanted, name):
        self.assertEqual((got.shape, got.dtype), (wanted.shape, wanted.dtype), name)
        self.assertTrue((got == wanted).all(), name)

    def check_place(self, got_origin, got_size, grid):
        np.testing.assert_allclose(got_size, grid["voxel_size"], rtol=1e-12)
        np.testing.assert_allclose(got_origin, grid["origin"], rtol=0, atol=1e-11)

    def test_raw_arrays_are_those_of_the_npz(self):
        for query in (SURFACE, SOLID, BAND):
            for place in PLACES + ("&dtype=float32",):
                grid = self.npz(query + place)
                for name in self.channels(grid):
                    array, fields = read_raw(self.voxelize(f"{query}{place}&format=raw&channel={name}").body)
                    self.check_same(array, self.world(grid, name), (query, place, name))
                    axes = re.findall(r"[-0-9.e+]+", fields["space directions"].replace("none", ""))
                    origin = np.array(fields["space origin"].strip("()").split(","), float)
                    self.check_place(origin - grid["voxel_size"] / 2,
                                     np.array(axes, float).reshape(3, 3).diagonal(), grid)

    def test_teem_reads_a_raw_array_by_its_header(self):
        grid = self.npz(SURFACE)
        with tempfile.TemporaryDirectory() as directory:
            for name in self.channels(grid):
                for file, data in members(self.voxelize(f"{SURFACE}&units=mm&format=raw&channel={name}").body).items():
                    (pathlib.Path(directory) / file).write_bytes(data)
                subprocess.run(["teem-unu", "save", "-f", "nrrd", "-e", "raw", "-i", "grid.nhdr", "-o", "copy.nrrd"],
                               cwd=directory, check=True, capture_output=True)
                head, body = (pathlib.Path(directory) / "copy.nrrd").read_bytes().split(b"\n\n", 1)
                self.assertEqual(body, grid[name].tobytes(), name)
                lines = dict(line.split(": ", 1) for line in head.decode().splitlines() if ": " in line)
                self.assertEqual(lines["space units"], '"mm" "mm" "mm"')
                origin = [float(n) for n in lines["space origin"].strip("()").split(",")]
                np.testing.assert_allclose(origin, grid["origin"] + grid["voxel_size"] / 2, rtol=1e-9)

    def test_textures_are_the_arrays_of_the_npz(self):
        for query in (SURFACE, SOLID, BAND):
            for place in PLACES + ("&dtype=float32",):
                grid = self.npz((query + place).replace("&dtype=float32", ""))
                for name in self.channels(grid):
                    texels, values = read_ktx2(self.voxelize(f"{query}{place}&format=ktx2&channel={name}").body)
                    wanted = self.world(grid, name)
                    if name == "occupancy":
                        wanted = wanted * np.uint8(255)
                    if name == "normal":
                        alpha = np.where(wanted.any(-1), 127, 0).astype(np.int8)
                        wanted = np.concatenate([wanted, alpha[..., None]], -1)
                    self.check_same(texels, wanted, (query, place, name))
                    words = [[float(n) for n in values["voxeld." + key].split()] for key in ("origin", "voxel_size")]
                    self.check_place(*words, grid)
                    self.assertEqual(json.loads(values["voxeld.meta"]), json.loads(bytes(grid["meta"])))

    def check_pixels(self, pixels, facts, grid, name):
        wanted = grid[name]
        if name in ("color", "material", "label"):
            self.assertTrue((pixels == wanted).all(), name)
            return
        values = pixels.astype(float) * facts["scale"] + facts["offset"]
        if name == "normal":
            empty = ~wanted.any(-1)
            self.assertFalse(pixels[empty].any())
            np.testing.assert_allclose(values[~empty], wanted[~empty] / 127, atol=0.5 / 127.5 + 1e-9)
        elif name == "distance":
            np.testing.assert_allclose(values, self.world(grid, name), rtol=1e-6, atol=1e-9)
        else:
            np.testing.assert_allclose(values, wanted / (255 if name == "coverage" else 1), atol=1e-9)

    def check_facts(self, facts, grid, name):
        self.assertEqual(facts["dims"], list(grid["occupancy"].shape[::-1]))
        self.check_place(facts["origin"], facts["voxel_size"], grid)
        centre = np.array(facts["transform"]) @ [0, 0, 0, 1]
        np.testing.assert_allclose(centre[:3], grid["origin"] + grid["voxel_size"] / 2, atol=1e-11)
        self.assertEqual((facts["channel"], facts["axes"]), (name, {"column": "x", "row": "y", "slice": "z"}))
        self.assertEqual(facts["meta"], json.loads(bytes(grid["meta"])))

    def test_slices_stacked_are_the_array_of_the_npz(self):
        modes = {"occupancy": ("L",), "color": ("RGBA",), "normal": ("RGB",), "coverage": ("L",)}
        for query in (SURFACE, SOLID, BAND):
            for place in PLACES:
                grid = self.npz(query + place)
                for name in self.channels(grid):
                    files = members(self.voxelize(f"{query}{place}&format=slices&channel={name}").body)
                    facts = json.loads(files.pop("slices.json"))
                    self.check_facts(facts, grid, name)
                    self.assertEqual(list(files), [f"slice-{z:04}.png" for z in range(len(grid["occupancy"]))])
                    images = [read_png(data) for data in files.values()]
                    self.assertIn(images[0].mode, modes.get(name, ("I", "I;16")))
                    self.check_pixels(pixels_of(images), facts, grid, name)

    def test_an_atlas_has_the_slices(self):
        for query, names in ((SURFACE, ("occupancy", "color", "label")), (BAND, ("distance",))):
            grid = self.npz(query)
            for name in names:
                files = members(self.voxelize(f"{query}&format=slices&layout=atlas&channel={name}").body)
                self.assertEqual(list(files), ["slices.json", "atlas.png"])
                facts = json.loads(files["slices.json"])
                self.check_facts(facts, grid, name)
                nx, ny, nz = facts["dims"]
                atlas = np.asarray(read_png(files["atlas.png"]))
                rows, columns = facts["rows"], facts["columns"]
                self.assertEqual(atlas.shape[:2], (rows * ny, columns * nx))
                tiles = atlas.reshape(rows, ny, columns, nx, *atlas.shape[2:]).swapaxes(1, 2)
                stack = tiles.reshape(rows * columns, ny, nx, *atlas.shape[2:])
                self.assertFalse(stack[nz:].any())
                self.check_pixels(stack[:nz], facts, grid, name)

    def test_pixels_have_a_size_where_units_are_known(self):
        grid = self.npz("size=20")
        image = read_png(members(self.voxelize("size=20&units=mm&format=slices").body)["slice-0000.png"])
        per_inch = 25.4 / grid["voxel_size"][0]
        np.testing.assert_allclose([float(n) for n in image.info["dpi"]], per_inch, rtol=1e-2)
        image = read_png(members(self.voxelize("size=20&format=slices").body)["slice-0000.png"])
        self.assertNotIn("dpi", image.info)

    def test_an_atlas_too_large_is_refused(self):
        beside = "dims=16384,16384,2&bounds=1000,1000,1000,1001,1001,1001"  # no voxels there
        response = self.daemon.post(f"/v1/voxelize?{beside}&format=slices&layout=atlas&filename=sample.obj.zip",
                                    self.fixture("sample.obj.zip"))
        self.assert_problem(response, 422, "grid-too-large", "atlas", "32767", "16384 x 32768", "layout=dense")

    def test_media_types_and_frames(self):
        for form, media_type in MEDIA_TYPES.items():
            self.assertEqual(self.voxelize(f"size=20&format={form}").headers["Content-Type"], media_type)
        query = "animation=walk&size=24&channels=color"
        frames = np.load(io.BytesIO(self.voxelize(query + "&format=npz", "worm.md5.zip").body))["color"]
        for form, extension in (("ktx2", "ktx2"), ("raw", "raw.zip"), ("slices", "slices.zip")):
            response = self.voxelize(f"{query}&format={form}&channel=color", "worm.md5.zip")
            self.assertEqual(response.headers["Content-Type"], "application/zip")
            files = members(response.body)
            self.assertEqual(list(files), [f"frame-{i:04}.{extension}" for i in range(len(frames))])
            for data, wanted in zip(files.values(), frames):
                if form == "ktx2":
                    got = read_ktx2(data)[0]
                elif form == "raw":
                    got = read_raw(data)[0]
                else:
                    got = pixels_of([read_png(png) for name, png in members(data).items() if name.endswith("png")])
                self.assertTrue((got == wanted).all(), form)


if __name__ == "__main__":
    unittest.main()
