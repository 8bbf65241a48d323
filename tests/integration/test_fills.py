"""Solids and shells through the daemon: what is inside, the report of it, and what is refused."""
import io
import json
import unittest

import numpy as np

from harness import DaemonTest

# A box of 10 x 10 x 10, wound outwards; faces in pairs of triangles, the top (z = 10) last.
CORNERS = [(x, y, z) for z in (0, 10) for y in (0, 10) for x in (0, 10)]
FACES = [(0, 2, 1), (1, 2, 3), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6),
         (1, 3, 5), (3, 7, 5), (4, 5, 6), (5, 7, 6)]


def off_file(faces):
    lines = ["OFF", f"{len(CORNERS)} {len(faces)} 0"]
    lines += [" ".join(map(str, corner)) for corner in CORNERS]
    lines += ["3 " + " ".join(map(str, face)) for face in faces]
    return "\n".join(lines).encode() + b"\n"


def sphere_stl(around, along, radius):
    """A sphere around 0 as a binary STL, wound outwards."""
    u = np.linspace(0, 2 * np.pi, around + 1)
    u[-1] = 0
    v = np.linspace(0, np.pi, along + 1)
    ring, height = np.sin(v)[:, None], np.cos(v)[:, None]
    ring[[0, -1]] = 0
    points = radius * np.stack([ring * np.cos(u), ring * np.sin(u), height + 0 * u], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], axis=-2)[:-1].reshape(-1, 3, 3),
                                np.stack([a, c, d], axis=-2)[1:].reshape(-1, 3, 3)])
    facets = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)),
                                       ("extra", "<u2")])
    facets["corners"] = triangles
    return bytes(80) + len(facets).to_bytes(4, "little") + facets.tobytes()


def triangle_distances(points, triangles):
    """The distance of each point (N, 3) to the nearest of the triangles."""
    least = np.full(len(points), np.inf)
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        height = (points - a) @ normal
        foot = points - a - height[:, None] * normal
        s, t = np.linalg.lstsq(np.stack([b - a, c - a], 1), foot.T, rcond=None)[0]
        least = np.where((s >= 0) & (t >= 0) & (s + t <= 1), np.minimum(least, np.abs(height)), least)
        for p, q in ((a, b), (b, c), (c, a)):
            u = np.clip((points - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            least = np.minimum(least, np.linalg.norm(points - p - u[:, None] * (q - p), axis=1))
    return least


class Fills(DaemonTest):
    def voxelize(self, mesh, query):
        response = self.daemon.post(f"/v1/voxelize?format=npy&filename=box.off&{query}", mesh)
        self.assertEqual(response.status, 200, response.body)
        meta = json.loads(response.headers["X-Voxeld-Meta"])
        return np.load(io.BytesIO(response.body)), meta

    def test_a_closed_mesh_is_solid_by_every_sign(self):
        for sign in ("auto", "parity", "nonzero", "majority", "flood", "winding"):
            with self.subTest(sign):
                grid, meta = self.voxelize(off_file(FACES), f"size=20&fill=solid&sign={sign}")
                self.assertEqual(grid.shape, (20, 20, 20))
                self.assertTrue(grid.all())
                solid = meta["solid"]
                self.assertEqual(solid["sign"], "nonzero" if sign == "auto" else sign)
                self.assertIs(solid["closed"], True)
                self.assertEqual(solid["open_edges"], 0)
                self.assertEqual(solid["components"], 1)
                self.assertEqual(solid["inner_walls"], 0)
                self.assertEqual(solid["ambiguous_fraction"], 0)

    def test_a_shell_is_hollow_at_its_thickness(self):
        grid, _ = self.voxelize(off_file(FACES), "size=20&fill=shell&thickness=3")
        self.assertTrue(grid[:4].all())
        self.assertEqual(int((grid == 0).sum()), 12 ** 3)
        self.assertFalse(grid[4:16, 4:16, 4:16].any())

    def test_an_open_mesh_is_distinguished(self):
        grid, meta = self.voxelize(off_file(FACES[:-2]), "size=20&fill=solid&padding=4")
        solid = meta["solid"]
        self.assertEqual(solid["sign"], "majority")
        self.assertIn("does not close at 4 edges", solid["reason"])
        self.assertIs(solid["closed"], False)
        self.assertEqual(solid["open_edges"], 4)
        self.assertGreater(solid["ambiguous_fraction"], 0.1)
        # All of the box but some of what is right below the missing face.
        self.assertTrue(grid[4:14, 4:16, 4:16].all())
        self.assertFalse(grid[:4].any())
        self.assertFalse(grid[17:].any())

    def warnings(self, mesh, query):
        response = self.daemon.post(f"/v1/voxelize?format=npy&filename=box.off&{query}", mesh)
        self.assertEqual(response.status, 200, response.body)
        job = self.daemon.get(f"/v1/jobs/{response.headers['X-Voxeld-Job']}").json()
        return [(w["code"], w["detail"]) for w in job["result"].get("warnings", [])]

    def test_the_winding_of_faces_does_not_matter(self):
        expected, _ = self.voxelize(off_file(FACES), "size=40&fill=solid&rule=none")
        self.assertEqual(int(expected.sum()), 40 ** 3)
        inward = [face[::-1] for face in FACES]
        mixed = [face[::-1] if i % 2 else face for i, face in enumerate(FACES)]
        for faces in (inward, mixed):
            grid, meta = self.voxelize(off_file(faces), "size=40&fill=solid&rule=none")
            self.assertTrue((grid == expected).all())
            self.assertEqual(meta["solid"]["ambiguous_fraction"], 0)

    def test_grids_that_are_hardly_meant_come_with_a_warning(self):
        box = off_file(FACES)
        self.assertEqual(self.warnings(box, "size=20&fill=solid"), [])
        # Wound inwards, it has no winding number above 1/2.
        inward = off_file([face[::-1] for face in FACES])
        (code, detail), = self.warnings(inward, "size=20&fill=solid&sign=winding")
        self.assertEqual(code, "empty-solid")
        self.assertIn("no cell is inside by sign=winding, but some are by sign=majority", detail)
        # Twice the same faces: every column crosses an even number of them at once.
        (code, detail), = self.warnings(off_file(FACES + FACES), "size=20&fill=solid&sign=parity")
        self.assertEqual(code, "empty-solid")
        self.assertIn("sign=flood", detail)
        (code, detail), = self.warnings(off_file(FACES[:-2]), "size=20&fill=solid&padding=4")
        self.assertEqual(code, "ambiguous-solid")
        self.assertRegex(detail, r"disagree about \d+% of the cells inside")
        (code, detail), = self.warnings(box, "voxel_size=1&bounds=100,100,100,110,110,110")
        self.assertEqual(code, "no-voxels")
        self.assertIn("beside its box", detail)

    def test_a_band_lies_on_both_sides(self):
        grid, _ = self.voxelize(off_file(FACES), "voxel_size=0.5&padding=6&fill=band")
        # Cell centres stand a quarter beside the faces: 3 voxels in, 3 out.
        row = grid[16, 16]
        self.assertEqual(np.flatnonzero(row).tolist(), [*range(3, 9), *range(23, 29)])
        wider, _ = self.voxelize(off_file(FACES), "voxel_size=0.5&padding=6&fill=band&thickness=5")
        self.assertEqual(np.flatnonzero(wider[16, 16]).tolist(), [*range(1, 11), *range(21, 31)])

    def test_a_band_is_a_signed_distance_field(self):
        radius = 28.0
        mesh = sphere_stl(300, 150, radius)
        fields = {}
        for axes in ("zyx", "xyz"):
            response = self.daemon.post(
                f"/v1/voxelize?voxel_size=1&padding=6&fill=band&format=npz&axes={axes}&filename=s.stl",
                mesh)
            self.assertEqual(response.status, 200, response.body)
            archive = np.load(io.BytesIO(response.body))
            fields[axes] = archive["distance"]
        field, origin = fields["zyx"], archive["origin"]
        self.assertTrue((fields["xyz"].transpose(2, 1, 0) == field).all())
        self.assertEqual(field.dtype, np.float32)
        z, y, x = (np.indices(field.shape) + 0.5 + origin[::-1].reshape(3, 1, 1, 1))
        exact = np.sqrt(x * x + y * y + z * z) - radius
        band = archive["occupancy"].transpose(2, 1, 0) != 0
        self.assertTrue((np.abs(field - exact)[band] < 0.01).all())
        self.assertTrue((np.abs(exact)[band] < 3.01).all())
        self.assertTrue((np.abs(exact)[~band] > 2.99).all())
        # Beside the band: its thickness, with the sign of the side.
        beside = field[~band]
        self.assertTrue((np.sign(beside) == np.sign(exact[~band])).all())
        self.assertEqual(len(np.unique(np.abs(beside))), 1)
        self.assertAlmostEqual(float(abs(beside[0])), 3, delta=0.02)
        # Along x, signs change where the sphere is.
        a, b = field[..., :-1], field[..., 1:]
        at = np.nonzero((a < 0) != (b < 0))
        self.assertGreater(len(at[0]), 4000)
        zero = x[..., :-1][at] + a[at] / (a[at] - b[at])
        off = np.sqrt(zero**2 + y[..., :-1][at] ** 2 + z[..., :-1][at] ** 2) - radius
        self.assertLess(np.abs(off).max(), 0.015)

    def test_levels_and_parts_of_a_band_tell_sides_or_nothing(self):
        radius = 28.0
        mesh = sphere_stl(120, 60, radius)
        query = "/v1/voxelize?voxel_size=1&padding=6&fill=band&format=npz&filename=s.stl"
        grid = self.daemon.post(query, mesh).headers["X-Voxeld-Grid"]

        def sides(query, of=grid):
            """Of the cells without voxels: the part that is as the sphere says, and the part that is unknown."""
            response = self.daemon.get(f"/v1/grids/{of}?format=npz&{query}")
            self.assertEqual(response.status, 200, response.body)
            made = np.load(io.BytesIO(response.body))
            field, size, origin = made["distance"], made["voxel_size"][0], made["origin"]
            z, y, x = (np.indices(field.shape) + 0.5) * size + origin[::-1].reshape(3, 1, 1, 1)
            is_inside = x * x + y * y + z * z < radius * radius
            beside = made["occupancy"] == 0
            right = (field < 0) == is_inside
            meta = json.loads(response.headers["X-Voxeld-Meta"])
            return right[beside].mean(), np.isnan(field[beside]).mean(), meta.get("band_voxels")

        self.assertEqual(sides("level=1"), (1, 0, 1.5))
        self.assertEqual(sides("region=0,0,0,20,34,68"), (1, 0, None))
        self.assertEqual(sides("level=2"), (1, 0, 0.75))
        self.assertEqual(sides("level=1&level_rule=majority"), (1, 0, 0.75))
        for query, voxels in (("level=3", 0.375), ("level=3&level_rule=majority", 0),
                              ("level=1&level_rule=majority&hollow=1", 0),
                              ("hollow=1", 0), ("erode=1", 0), ("region=30,30,30,38,38,38", None)):
            self.assertEqual(sides(query)[1:], (1, voxels), query)
        half = self.daemon.get(f"/v1/grids/{grid}?level=1").headers["X-Voxeld-Grid"]
        self.assertEqual(sides("level=0", half)[1], 0)
        self.assertEqual(sides("level=1", half), (1, 0, 0.75))
        for query, unknown in (("level=1", 0), ("hollow=1", 1)):
            container = self.daemon.get(f"/v1/grids/{grid}?format=native&{query}").body
            again = self.daemon.post("/v1/voxelize?filename=band.voxg", container).headers["X-Voxeld-Grid"]
            self.assertEqual(sides("level=0", again)[1], unknown, query)

    def test_surfaces_and_solids_have_distances_where_they_are_asked_for(self):
        query = "size=20&padding=2&format=npz&filename=box.off&channels=distance"
        for fill in ("surface", "solid", "shell"):
            response = self.daemon.post(f"/v1/voxelize?{query}&fill={fill}", off_file(FACES))
            self.assertEqual(response.status, 200, response.body)
            distance = np.load(io.BytesIO(response.body))["distance"]
            # Cells are 0.625 wide: the first of them inside is 0.5 voxels beside the face.
            self.assertAlmostEqual(float(distance[10, 10, 2]), -0.5, delta=0.01)
            self.assertGreater(float(distance[10, 10, 1]), 0)
            self.assertEqual(float(distance[10, 10, 10]) < 0, fill == "solid")

    def test_distances_are_in_voxels_or_in_world_units(self):
        corners = np.array([(0, 0, 0), (9, 1, 0.5), (2, 8, 1), (3, 2, 7)], float)
        faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
        mesh = "\n".join(["OFF", "4 4 0", *(" ".join(map(str, corner)) for corner in corners),
                          *("3 " + " ".join(map(str, face)) for face in faces)]).encode() + b"\n"
        triangles = corners[np.array(faces)]

        def npz(query):
            response = self.daemon.post(f"/v1/voxelize?filename=t.off&format=npz&{query}", mesh)
            self.assertEqual(response.status, 200, response.body)
            return np.load(io.BytesIO(response.body))

        query = "voxel_size=0.25,0.75,0.4&padding=3&fill=band&thickness=2"
        fields, occupied = {}, {}
        for unit in ("voxels", "world"):
            grid = npz(f"{query}&distance={unit}")
            size, field = grid["voxel_size"], grid["distance"]
            self.assertEqual(size.tolist(), [0.25, 0.75, 0.4])
            band = occupied[unit] = grid["occupancy"] > 0
            z, y, x = np.indices(field.shape).reshape(3, -1)
            points = grid["origin"] + (np.stack([x, y, z], 1) + 0.5) * size
            edges = np.ones(3) if unit == "world" else size  # of the space in which distances are taken
            exact = triangle_distances(points / edges, triangles / edges).reshape(field.shape)
            # Half a step, and what snapping moves: half of 1/256 voxel along each axis.
            off = (size / edges).min() / 256 + np.linalg.norm(size / edges) / 512 + 1e-6
            np.testing.assert_allclose(np.abs(field[band]), exact[band], rtol=0, atol=off)
            self.assertEqual(np.unique(np.abs(field[~band])).tolist(), [np.abs(field[band]).max()])
            fields[unit] = field
        # Voxels and signs are the same, and most distances are not.
        self.assertTrue((occupied["voxels"] == occupied["world"]).all())
        band = occupied["world"]
        self.assertTrue((np.sign(fields["voxels"]) * np.sign(fields["world"]) >= 0).all())
        ratio = fields["world"][band] / np.where(fields["voxels"][band] == 0, np.nan, fields["voxels"][band])
        self.assertLess(np.nanmin(ratio), 0.35)
        self.assertGreater(np.nanmax(ratio), 0.6)

        # The distance of cubes is that in voxels, times the edge.
        cubes = "voxel_size=0.3&padding=2&fill=solid&channels=distance"
        in_voxels, in_world = npz(cubes), npz(cubes + "&distance=world")
        edge = in_world["voxel_size"][0]
        self.assertTrue((in_world["distance"] == (in_voxels["distance"].astype(float) * edge).astype(np.float32)).all())
        # Other formats have the same values, and do not warn.
        response = self.daemon.post(f"/v1/voxelize?filename=t.off&format=csv&{query}&distance=world", mesh)
        self.assertEqual(response.headers.get("X-Voxeld-Warnings"), None)
        table = np.genfromtxt(io.BytesIO(response.body), delimiter=",", names=True)
        at = tuple(table[axis].astype(int) for axis in "zyx")
        self.assertTrue((table["distance"].astype(np.float32) == fields["world"][at]).all())
        response = self.daemon.post("/v1/voxelize?filename=t.off&voxel_size=1,300,1&fill=band&distance=world", mesh)
        self.assertEqual((response.status, response.json()["code"]), (400, "invalid-option"), response.body)

    def test_a_solid_that_is_cut_shows_the_colours_of_its_surface(self):
        query = "size=20&fill=solid&color=axis&format=npz&filename=box.off"
        colors = {}
        for interior in ("none", "nearest"):
            response = self.daemon.post(f"/v1/voxelize?{query}&interior={interior}", off_file(FACES))
            self.assertEqual(response.status, 200, response.body)
            colors[interior] = np.load(io.BytesIO(response.body))["color"]
        self.assertEqual(colors["none"][10, 10, 2].tolist(), [0, 0, 0, 0])
        # Nearest to the faces of low x and of low z.
        self.assertEqual(colors["nearest"][10, 10, 2].tolist(), [255, 0, 0, 255])
        self.assertEqual(colors["nearest"][2, 10, 10].tolist(), [0, 0, 255, 255])
        self.assertTrue((colors["nearest"][..., 3] == 255).all())

    def test_the_pipelines_give_the_same_solid(self):
        mesh = self.fixture("sample.ply")
        for fill in ("solid", "solid&interior=nearest&channels=color,normal", "band"):
            hashes = set()
            for pipeline in ("raster", "compute", "cpu"):
                response = self.daemon.post(
                    f"/v1/voxelize?size=60&fill={fill}&pipeline={pipeline}&filename=a.ply", mesh)
                self.assertEqual(response.status, 200, response.body)
                hashes.add(response.headers["X-Voxeld-Content-Hash"])
            self.assertEqual(len(hashes), 1, fill)
            self.assertNotIn(None, hashes)

    def test_a_surface_has_no_report_of_a_fill(self):
        _, meta = self.voxelize(off_file(FACES), "size=20")
        self.assertNotIn("solid", meta)

    def test_every_response_reports_how_the_mesh_closes(self):
        _, meta = self.voxelize(off_file(FACES[:-2]), "size=20")
        mesh = meta["mesh"]
        self.assertEqual(mesh["open_edges"], 4)
        self.assertIs(mesh["watertight"], False)
        self.assertIs(mesh["closed"], False)
        self.assertEqual(mesh["components"], 1)
        self.assertEqual(mesh["inner_walls"], 0)
        self.assertIsNone(mesh["ambiguous_fraction"])
        _, again = self.voxelize(off_file(FACES[:-2]), "size=21&fill=solid")
        for name in ("open_edges", "closed", "components", "ambiguous_fraction"):
            self.assertEqual(again["mesh"][name], again["solid"][name])
        self.assertEqual(again["mesh"]["open_edges"], 4)


if __name__ == "__main__":
    unittest.main()
