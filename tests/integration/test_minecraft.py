"""Schematics, litematics and structures, read by readers of their own and compared with the npz of the same grid."""
import io
import json
import sys
import zipfile

import numpy as np

from harness import ROOT, DaemonTest
from minecraft_readers import READERS, block_table, distances, oklab

sys.path.insert(0, str(ROOT / "tests/unit/formats"))
from vox_scene import Vox  # noqa: E402

NAMES, GROUPS, COLORS = block_table()


class Minecraft(DaemonTest):
    def voxelize(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def blocks(self, query, form, name="sample.glb"):
        return READERS[form](self.voxelize(f"{query}&format={form}", name).body)

    def npz(self, query, name="sample.glb"):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz", name).body))

    def check_nearest(self, names, colors, allowed):
        """Each name is the block of `allowed` (numbers in the table) that is nearest to its colour."""
        unique, where = np.unique(colors, axis=0, return_inverse=True)
        all_distances = distances(unique, COLORS[allowed])
        number = {NAMES[block]: column for column, block in enumerate(allowed)}
        chosen = np.array([number[name] for name in names])
        own = all_distances[where.ravel(), chosen]
        np.testing.assert_allclose(own, all_distances.min(1)[where.ravel()], rtol=0, atol=1e-6)

    def check_cells(self, blocks, grid, allowed=range(len(NAMES))):
        names, occupied = blocks.of_cells(), grid["occupancy"] > 0
        self.assertEqual(names.shape, occupied.shape)
        self.assertTrue(((names != "air") == occupied).all())
        colored = occupied & (grid["color"][..., 3] > 0)
        self.check_nearest(names[colored], grid["color"][colored][:, :3], list(allowed))
        inside = np.unique(names[occupied & ~colored])
        self.assertLessEqual(len(inside), 1)  # the block of the mean colour

    def test_every_cell_has_the_block_nearest_to_its_colour(self):
        for query in ("size=41", "size=64&fill=solid", "size=60&level=1",
                      "size=300&region=20,150,20,90,250,100"):
            grid = self.npz(query)
            for form in READERS:
                self.check_cells(self.blocks(query, form), grid)

    def test_a_grid_of_more_than_a_piece_of_cells_is_whole(self):
        query = "size=150"
        grid = self.npz(query)
        self.assertGreater(grid["occupancy"].size, 1 << 20)
        for form in ("schem", "litematic"):
            self.check_cells(self.blocks(query, form), grid)

    def test_blocks_restrict_the_palette(self):
        grid = self.npz("size=40")
        for given, allowed in (("wool", [i for i, group in enumerate(GROUPS) if group == "wool"]),
                               ("minecraft:stone,dirt,red_wool",
                                [NAMES.index(name) for name in ("stone", "dirt", "red_wool")])):
            for form in READERS:
                self.check_cells(self.blocks(f"size=40&blocks={given}", form), grid, allowed)

    def test_dither_keeps_the_mean_colour_better(self):
        """The mean of the whole model, with few blocks: a mixture is nearer to its mean than the nearest blocks are."""
        grid = self.npz("size=64")
        occupied = grid["occupancy"] > 0
        own = oklab(grid["color"][occupied][:, :3]).mean(0)

        def error(dither):
            chosen = "white_concrete,black_concrete,red_concrete,lime_concrete,blue_concrete"
            names = self.blocks(f"size=64&dither={dither}&blocks={chosen}", "schem").of_cells()
            self.assertTrue(((names != "air") == occupied).all())
            used, where = np.unique(names[occupied], return_inverse=True)
            labs = oklab(np.array([COLORS[NAMES.index(name)] for name in used]))
            return np.linalg.norm(labs[where.ravel()].mean(0) - own)

        nearest = error("none")
        self.assertLess(error("bayer"), 0.7 * nearest)
        self.assertLess(error("error"), 0.5 * nearest)

    def test_vox_dithers_its_palette(self):
        query = "animation=walk&frames=0..1&size=60&color=shaded"
        frames = self.npz(query, "worm.md5.zip")
        colors = [frames["color"][i][frames["occupancy"][i] > 0][:, :3] for i in range(2)]
        self.assertGreater(len(np.unique(colors[0], axis=0)), 10)

        def errors(dither):
            vox = Vox(self.voxelize(f"{query}&format=vox&palette=3&dither={dither}", "worm.md5.zip").body)
            rows = [vox.frame(i) for i in range(2)]
            self.assertEqual([len(row) for row in rows], [len(own) for own in colors])
            self.assertEqual(len(np.unique(np.concatenate(rows)[:, 3:], axis=0)), 3)
            return np.array([np.linalg.norm(oklab(row[:, 3:]).mean(0) - oklab(own).mean(0))
                             for row, own in zip(rows, colors)])

        for dither in ("bayer", "error"):
            self.assertTrue((errors(dither) < 0.03).all(), (dither, errors(dither)))
        body = self.voxelize(query + "&format=vox&palette=3", "worm.md5.zip").body
        self.assertNotEqual(body, self.voxelize(query + "&format=vox&palette=3&dither=bayer", "worm.md5.zip").body)

    def test_grids_without_colours_are_of_stone(self):
        for form in READERS:
            names = self.blocks("size=20", form, "sample.off").of_cells()
            self.assertEqual(sorted(np.unique(names)), ["air", "stone"])

    def test_place_and_units_are_in_the_file_and_warnings_name_what_is_not(self):
        query = "size=100&units=cm&channels=occupancy,color,normal,label"
        grid = self.npz(query)
        expected = "lost-channels, not-metres"
        for form in READERS:
            response = self.voxelize(f"{query}&format={form}")
            self.assertEqual(response.headers["X-Voxeld-Warnings"],
                             expected + (", large-structure" if form == "nbt" else ""))
            tags = READERS[form](response.body).tags
            place = tags["voxeld"] if form == "nbt" else tags["Metadata"]["voxeld"]
            self.assertEqual(place["origin"], list(grid["origin"]))
            self.assertEqual(place["voxel_size"], list(grid["voxel_size"]))
            self.assertEqual(place["units"], "cm")
        job = self.daemon.get(f"/v1/jobs/{response.headers['X-Voxeld-Job']}").json()
        details = [warning["detail"] for warning in job["result"]["warnings"]]
        self.assertIn("nbt: blocks have no place for normal, label", details)

    def test_frames_are_a_zip_of_files(self):
        query = "animation=walk&size=40"
        frames = self.npz(query, "worm.md5.zip")
        for form, read in READERS.items():
            response = self.voxelize(f"{query}&format={form}", "worm.md5.zip")
            self.assertEqual(response.headers["Content-Type"], "application/zip")
            archive = zipfile.ZipFile(io.BytesIO(response.body))
            extension = form.partition("&")[0]
            self.assertEqual(archive.namelist(), [f"frame-{i:04}.{extension}" for i in range(6)])
            for i in range(6):
                grid = {name: frames[name][i] for name in ("occupancy", "color")}
                self.check_cells(read(archive.read(f"frame-{i:04}.{extension}")), grid)

    def test_equal_requests_give_equal_bytes(self):
        for form in READERS:
            for dither in ("none", "bayer", "error"):
                query = f"size=70&format={form}&dither={dither}&cache=no"
                self.assertEqual(self.voxelize(query).body, self.voxelize(query).body)

    def test_accept_and_results_in_other_formats_take_the_options(self):
        body = self.fixture("sample.glb")
        options = "blocks=wool&dither=bayer&schem_version=3"
        wool = self.voxelize(f"size=24&format=schem&{options}").body
        accept = {"Accept": "application/x-schem"}
        response = self.daemon.request("POST", f"/v1/voxelize?size=24&{options}&filename=sample.glb", body, accept)
        self.assertEqual((response.status, response.body == wool), (200, True))
        job = self.voxelize("size=24").headers["X-Voxeld-Job"]
        for path, headers in ((f"/v1/jobs/{job}/result?format=schem&{options}", {}),
                              (f"/v1/jobs/{job}/result?{options}", accept)):
            response = self.daemon.request("GET", path, None, headers)
            self.assertEqual(response.headers["Content-Type"], "application/x-schem")
            self.assertEqual(response.body, wool)

    def test_lists_of_blocks_in_json_are_those_of_a_query(self):
        asset = self.daemon.upload(self.fixtures / "sample.glb")
        texts = []
        for blocks in ("red_wool,concrete", ["concrete", "minecraft:red_wool"]):
            job = self.daemon.submit(kind="voxelize", asset=asset,
                                     options={"size": 20, "format": "schem", "blocks": blocks})
            self.daemon.wait(job)
            status = self.daemon.get(f"/v1/jobs/{job}").json()
            texts.append(status["options"]["blocks"])
        self.assertEqual(texts, [["concrete", "red_wool"]] * 2)

    def test_options_and_sizes_that_do_not_fit_are_refused(self):
        groups = ", ".join(dict.fromkeys(GROUPS))
        for query, name, expected, got in (
                ("format=vox&blocks=wool", "blocks", "format schem, litematic or nbt with it", '"vox"'),
                ("format=ply&dither=error", "dither",
                 "format vox, schem, litematic or nbt, or colours as palette with it", '"ply"'),
                ("format=nbt&schem_version=2", "schem_version", "format schem with it", '"nbt"'),
                ("format=nbt&blocks=stone,conrete", "blocks",
                 f"names of blocks or of groups: {groups}; did you mean 'concrete'?", '"conrete"'),
                ("format=schem&dims=2048,1024,1024", "schem: too many cells", "at most 2147483647", "2147483648"),
                ("format=litematic&dims=2048,1024,1024", "litematic: too many cells", "at most 2147483647",
                 "2147483648")):
            response = self.daemon.post("/v1/voxelize?filename=sample.glb&" + query, self.fixture("sample.glb"))
            problem = json.loads(response.body)
            self.assertEqual((problem["detail"], problem["expected"], problem["got"]), (name, expected, got))
            self.assertEqual(problem["code"], "grid-too-large" if "dims" in query else "invalid-option")
