"""NanoVDB files, by NanoVDB's own programs, against the .vdb of the same grid.

nanovdb_convert makes a .vdb of a .nvdb, which pyopenvdb reads, and a .nvdb of a .vdb, which has the same bytes but for
rounding in its place and in the statistics of its nodes."""
import io
import pathlib
import re
import shutil
import struct
import subprocess
import tempfile
import unittest
import zipfile
import zlib

import numpy as np
import pyopenvdb

from harness import DaemonTest

PROGRAMS = ("nanovdb_convert", "nanovdb_print", "nanovdb_validate")
MISSING = [program for program in PROGRAMS if shutil.which(program) is None]

SURFACE = "size=61&channels=color,normal,label&labels=material"
SOLID = "size=48&fill=solid&channels=color,material,coverage"
BAND = "size=40&fill=band"
DISTANCES = "size=40&fill=solid&channels=distance"
BOXES = "dims=20,30,16&bounds=-1,-1,-1,1,3,1&channels=color,distance"
WIDE = "dims=300,20,20&bounds=-15,-1,-1,15,1,1&fill=solid&channels=normal"
EMPTY = SURFACE + "&region=0,0,0,2,2,2"
QUERIES = (SURFACE, SURFACE + "&level=1", SOLID, SOLID + "&region=10,5,3,36,17,18", BAND, DISTANCES, BOXES, WIDE, EMPTY)

GRID_BYTES, TREE_BYTES = 672, 64
# Offset of the root's statistics, bytes of the root; bytes of each node and the offset of its statistics, from the leaf
# up.
SCALARS = (32, 64, ((2144, 80), (33856, 1056), (270400, 8224)))
VECTORS = (40, 96, ((6272, 80), (66624, 1056), (532544, 8224)))
LAYOUTS = {1: SCALARS, 4: SCALARS, 6: VECTORS}


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def segments(data):
    """Each grid's facts and bytes, by name; a file has a segment for all grids or for each."""
    grids, at = {}, 0
    while at < len(data):
        magic, _, count, codec = struct.unpack_from("<8sIHH", data, at)
        assert magic == b"NanoVDB0" and codec == 1
        at += 16
        facts = []
        for _ in range(count):
            name_bytes, = struct.unpack_from("<I", data, at + 136)
            facts.append((data[at + 176:at + 175 + name_bytes].decode(), data[at:at + 176]))
            at += 176 + name_bytes
        for name, of_grid in facts:
            size, stored = struct.unpack_from("<QQ", of_grid)
            grids[name] = of_grid, zlib.decompress(data[at + 8:at + stored])
            assert len(grids[name][1]) == size
            at += stored
    return grids


def without_numbers(data, *parts):
    """The bytes with zeros for the numbers at (offset, struct format), and these numbers."""
    rest, numbers = bytearray(data), []
    for offset, kind in parts:
        numbers += struct.unpack_from(kind, data, offset)
        rest[offset:offset + struct.calcsize(kind)] = bytes(struct.calcsize(kind))
    return bytes(rest), np.array(numbers)


def without_place(facts, grid):
    """Facts without the length in the file, and grid, without map, world box and voxel size; and these."""
    facts, of_facts = without_numbers(facts[:8] + facts[16:], (32, "<6d"), (104, "<3d"))
    grid, of_grid = without_numbers(grid, (296, "<22f"), (384, "<22d"), (560, "<9d"))
    return facts, grid, np.concatenate((of_facts, of_grid))


def without_statistics(grid):
    """The bytes with zeros for the checksums and the statistics of all nodes, and the scalar statistics."""
    kind, = struct.unpack_from("<I", grid, 636)
    root_statistics, root_bytes, nodes = LAYOUTS[kind]
    value_bytes = 12 if kind == 6 else 4
    leaves, lowers, uppers = struct.unpack_from("<3I", grid, GRID_BYTES + 32)
    root = GRID_BYTES + TREE_BYTES
    tiles, = struct.unpack_from("<I", grid, root + 24)
    places, at = [root + root_statistics], root + root_bytes + 32 * tiles
    for count, (node_bytes, offset) in zip((uppers, lowers, leaves), reversed(nodes)):
        places += [at + i * node_bytes + offset for i in range(count)]
        at += count * node_bytes
    assert at == len(grid)
    rest, found = bytearray(grid), []
    rest[8:16] = bytes(8)
    for place in places:
        # NanoVDB computes squared lengths of vectors in single precision, so it may choose another of two like ones.
        if kind != 6:
            found.append(struct.unpack_from("<i" if kind == 4 else "<f", grid, place) +
                         struct.unpack_from("<i" if kind == 4 else "<f", grid, place + 4))
        else:
            found.append(tuple(sum(v * v for v in struct.unpack_from("<3f", grid, place + i)) for i in (0, 12)))
        found[-1] += struct.unpack_from("<2f", grid, place + 2 * value_bytes)
        rest[place:place + 2 * value_bytes + 8] = bytes(2 * value_bytes + 8)
    return bytes(rest), np.array(found)


@unittest.skipIf(MISSING, f"{', '.join(MISSING)} of Debian's libnanovdb-tools: not installed")
class Nvdb(DaemonTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def voxelize(self, query, name="sample.obj.zip"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def file(self, query, name="sample.obj.zip", extension="nvdb"):
        path = self.folder / f"a.{extension}"
        response = self.voxelize(f"{query}&format={extension}", name)
        self.assertEqual(response.headers["Content-Type"], f"application/x-{extension}")
        path.write_bytes(response.body)
        return path

    def convert(self, source, name):
        path = self.folder / name
        code, text = run("nanovdb_convert", "-f", "-z", "-s", "all", "-c", "full", str(source), str(path))
        self.assertEqual(code, 0, text)
        return path

    def printed(self, path):
        """The columns of nanovdb_print for each grid, by name."""
        code, text = run("nanovdb_print", "-l", str(path))
        self.assertEqual(code, 0, text)
        rows = re.findall(r"^\d+ .*$", text, re.M)
        columns = [re.split(r"  +", row.strip()) for row in rows]
        return {row[1]: row[2:] for row in columns}

    def assert_valid(self, path):
        code, text = run("nanovdb_validate", "-v", str(path))
        self.assertEqual(code, 0, text)
        self.assertNotIn("failed", text)
        return re.findall(r'Grid named "(\w+)": passed', text)

    def test_nanovdb_validates_every_grid(self):
        for query in QUERIES:
            with self.subTest(query=query):
                path = self.file(query)
                self.assertEqual(sorted(self.assert_valid(path)), sorted(segments(path.read_bytes())))

    def test_validation_finds_one_wrong_voxel(self):
        data = bytearray(self.file(SURFACE).read_bytes())
        facts, grid = segments(data)["density"]
        wrong = bytearray(grid)
        wrong[-1] ^= 1
        stream = zlib.compress(wrong)
        head = bytearray(facts)
        struct.pack_into("<Q", head, 8, len(stream) + 8)
        path = self.folder / "wrong.nvdb"
        path.write_bytes(struct.pack("<8sIHH", b"NanoVDB0", struct.unpack_from("<I", data, 8)[0], 1, 1) + head +
                         b"density\0" + struct.pack("<Q", len(stream)) + stream)
        self.assertIn("failed", run("nanovdb_validate", "-v", str(path))[1])

    def test_nanovdb_print_names_types_and_classes(self):
        npz = np.load(io.BytesIO(self.voxelize(SURFACE + "&format=npz").body))
        grids = self.printed(self.file(SURFACE))
        self.assertEqual({name: row[:4] for name, row in grids.items() if name != "alpha"},
                         {"density": ["float", "FOG", "32.4.2", "ZIP"], "color": ["Vec3f", "?", "32.4.2", "ZIP"],
                          "normal": ["Vec3f", "?", "32.4.2", "ZIP"], "label": ["int32", "?", "32.4.2", "ZIP"]})
        for row in grids.values():
            self.assertIn(str(int(npz["occupancy"].sum())), row)
        for query in (BAND, DISTANCES):
            self.assertEqual(self.printed(self.file(query))["surface"][:2], ["float", "SDF"])
        self.assertEqual(self.printed(self.file(BOXES))["surface"][:2], ["float", "?"])  # in voxels, which are no cubes
        self.assertIn("empty grid", self.printed(self.file(EMPTY))["density"])

    def test_as_a_vdb_it_has_the_voxels_of_the_vdb(self):
        for query in QUERIES:
            ours = self.file(query, extension="vdb")
            theirs = self.convert(self.file(query), "back.vdb")
            for name in segments((self.folder / "a.nvdb").read_bytes()):
                if name in ("label", "material"):
                    continue  # Debian's pyopenvdb knows no int32; the next test has them
                with self.subTest(query=query, grid=name):
                    self.check_same(pyopenvdb.read(str(ours), name), pyopenvdb.read(str(theirs), name))

    def check_same(self, ours, theirs):
        self.assertEqual((theirs.gridClass, theirs.background), (ours.gridClass, ours.background))
        for index in ((0, 0, 0), (5, 6, 7), (-3, 100, 2)):
            np.testing.assert_allclose(theirs.transform.indexToWorld(index), ours.transform.indexToWorld(index),
                                       rtol=1e-14, atol=1e-14)
        self.assertEqual((theirs.activeVoxelCount(), theirs.leafCount(), theirs.nonLeafCount()),
                         (ours.activeVoxelCount(), ours.leafCount(), ours.nonLeafCount()))
        on = [[(item.min, item.max, item.value) for item in grid.iterOnValues()] for grid in (ours, theirs)]
        self.assertEqual(*on)
        off = [[(item.min, item.max, item.value) for item in grid.iterOffValues()] for grid in (ours, theirs)]
        self.assertEqual(*off)

    def test_nanovdb_makes_the_same_bytes_of_the_vdb(self):
        for query in QUERIES:
            ours = segments(self.file(query).read_bytes())
            theirs = segments(self.convert(self.file(query, extension="vdb"), "back.nvdb").read_bytes())
            self.assertEqual(set(ours), set(theirs))
            for name in ours:
                with self.subTest(query=query, grid=name):
                    facts, grid, place = without_place(*ours[name])
                    their_facts, their_grid, their_place = without_place(*theirs[name])
                    self.assertEqual(facts, their_facts)
                    np.testing.assert_allclose(place, their_place, rtol=1e-12, atol=1e-12)
                    rest, statistics = without_statistics(grid)
                    their_rest, their_statistics = without_statistics(their_grid)
                    self.assertTrue(rest == their_rest)
                    scale = max(np.abs(their_statistics).max(), 1e-30)
                    np.testing.assert_allclose(statistics, their_statistics, rtol=1e-6, atol=1e-6 * scale)

    def test_a_solid_without_attributes_inside_has_its_tiles(self):
        path = self.file("size=120&fill=solid", "sample.off")
        self.assert_valid(path)
        (facts, grid) = segments(path.read_bytes())["density"]
        voxels, = struct.unpack_from("<Q", facts, 24)
        self.assertGreater(voxels, 100_000)
        self.assertLess(len(grid), 20e6)
        self.assertLess(path.stat().st_size, 1e6)

    def test_warnings_and_frames(self):
        response = self.voxelize(SURFACE + "&units=mm&format=nvdb")
        self.assertEqual(response.headers["X-Voxeld-Warnings"], "lost-names, lost-units")
        response = self.voxelize("size=20&animation=spin&frames=0..2&format=nvdb", "spin.glb")
        with zipfile.ZipFile(io.BytesIO(response.body)) as archive:
            self.assertEqual(archive.namelist(), [f"frame-000{i}.nvdb" for i in range(3)])
            for name in archive.namelist():
                self.assertIn("density", self.assert_valid(archive.extract(name, self.folder)))


if __name__ == "__main__":
    unittest.main()
