"""Files of blocks as prismarine-nbt and prismarine-schematic read them, which know the game's blocks by its own data. The
packages are those of package-lock.json; VOXELD_MINECRAFT_DIR is the folder that uses them."""
import base64
import io
import os
import pathlib
import sys
import unittest

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/integration"))
import npm_packages  # noqa: E402
from harness import DaemonTest  # noqa: E402
from minecraft_readers import READERS, block_table, distances  # noqa: E402

WORK = pathlib.Path(os.environ.get("VOXELD_MINECRAFT_DIR", ROOT / "build/dev/minecraft"))
NAMES, _, COLORS = block_table()
MEMBERS = {
    "schem": {"Version", "DataVersion", "Metadata", "Width", "Height", "Length", "Offset", "PaletteMax", "Palette",
              "BlockData", "BlockEntities"},
    "schem&schem_version=3": {"Schematic"},
    "litematic": {"MinecraftDataVersion", "Version", "SubVersion", "Metadata", "Regions"},
    "nbt": {"DataVersion", "author", "voxeld", "size", "palette", "blocks", "entities"},
}


class Prismarine(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        cls.reader = npm_packages.Program(HERE, WORK, "read_blocks.mjs")
        cls.addClassCleanup(cls.reader.end)
        super().setUpClass()

    def read_by_npm(self, data, what="nbt"):
        (WORK / "blocks.bin").write_bytes(data)
        return self.reader("blocks.bin", what)

    def voxelize(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response.body

    def npz(self, query):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz")))

    def schematic(self, query):
        """Names of blocks in the order z, y, x."""
        read = self.read_by_npm(self.voxelize(query + "&format=schem"), "schematic")["schematic"]
        self.assertEqual((read["version"], read["start"]), ("1.18.2", True))
        width, height, length = read["size"]
        cells = np.frombuffer(base64.b64decode(read["cells"]), np.uint8).reshape(height, length, width)
        return np.array(read["names"])[cells.transpose(1, 0, 2)]

    def test_prismarine_nbt_reads_every_byte_of_every_format(self):
        for form, members in MEMBERS.items():
            for query in ("size=30", "size=50&fill=solid", "size=8&bounds=100,100,100,101,101,101"):
                read = self.read_by_npm(self.voxelize(f"{query}&format={form}"))["nbt"]
                self.assertEqual(set(read["members"]), members)
                self.assertEqual(read["root"], "Schematic" if form == "schem" else "")
                self.assertEqual(read["read"], read["bytes"])

    def test_prismarine_schematic_reads_the_blocks_of_every_cell(self):
        for query in ("size=41", "size=40&fill=solid", "size=60&level=1"):
            grid, names = self.npz(query), self.schematic(query)
            occupied = grid["occupancy"] > 0
            self.assertEqual(names.shape, occupied.shape)
            self.assertTrue(((names != "air") == occupied).all())
            colored = occupied & (grid["color"][..., 3] > 0)
            chosen = np.array([NAMES.index(name) for name in names[colored]])
            by_block = distances(grid["color"][colored][:, :3], COLORS)
            own = by_block[np.arange(len(chosen)), chosen]
            np.testing.assert_allclose(own, by_block.min(1), rtol=0, atol=1e-6)
            own_reader = READERS["schem"](self.voxelize(query + "&format=schem")).of_cells()
            self.assertTrue((own_reader == names).all())

    def test_every_block_of_the_table_is_one_of_the_game(self):
        """A schem with a voxel of each block's own colour: its name would be replaced by air if the game had none."""
        lines = []
        for i, (r, g, b) in enumerate(COLORS / 255):
            x, z = 2 * (i % 12), 2 * (i // 12)
            lines += [f"v {x + dx} 0.5 {z + dz} {r} {g} {b}" for dx, dz in ((0.2, 0.2), (0.8, 0.2), (0.2, 0.8))]
            lines.append(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}")
        body = "\n".join(lines).encode()
        rows = (len(COLORS) + 11) // 12
        response = self.daemon.post(f"/v1/voxelize?dims=24,1,{2 * rows}&bounds=0,0,0,24,1,{2 * rows}&color=nearest"
                                    "&format=schem&filename=colors.obj", body)
        self.assertEqual(response.status, 200, response.body)
        read = self.read_by_npm(response.body, "schematic")["schematic"]
        self.assertEqual(sorted(read["names"]), sorted(["air", *NAMES]))
        self.assertEqual(READERS["schem"](response.body).cells.max(), len(NAMES))


if __name__ == "__main__":
    unittest.main()
