"""Meshes of grids, read by readers of their own and compared with the npz of the same grid."""
import io
import json
import zipfile

import numpy as np

from harness import DaemonTest
from mesh_readers import READERS, Glb, number_lists, unmatched_edges


class Meshes(DaemonTest):
    def voxelize(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def mesh(self, query, form, name="sample.glb"):
        return READERS[form](self.voxelize(f"{query}&format={form}", name).body)

    def npz(self, query, name="sample.glb"):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz", name).body))

    def outer_faces(self, grid):
        """For each axis and direction: cells (z, y, x) with an empty neighbour."""
        occupancy = np.pad(grid["occupancy"], 1)
        faces = {}
        for axis in range(3):
            for up in (False, True):
                beside = np.roll(occupancy, -1 if up else 1, axis)
                faces[2 - axis, up] = ((occupancy == 1) & (beside == 0))[1:-1, 1:-1, 1:-1]
        return faces

    def check_faces(self, mesh, grid, tolerance=1e-5):
        """The triangles cover the outer faces of the voxels by area, each with its voxel's colour."""
        expected = self.outer_faces(grid)
        size, origin = grid["voxel_size"], grid["origin"]
        triangles = mesh.triangles()
        corners = (mesh.points[triangles] - origin) / size
        np.testing.assert_allclose(corners, corners.round(), atol=tolerance * 100)
        corners = corners.round()
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.assertTrue(((normals != 0).sum(1) == 1).all())  # along an axis, and not without area
        for (axis, up), faces in expected.items():
            area = normals[:, axis] if up else -normals[:, axis]
            of_direction = area > 0
            planes = corners[of_direction, 0, axis].astype(int) - (1 if up else 0)
            by_plane = np.bincount(planes, area[of_direction] / 2, faces.shape[2 - axis])
            others = tuple(i for i in range(3) if i != 2 - axis)
            np.testing.assert_array_equal(by_plane, faces.sum(others))
        self.assertEqual(unmatched_edges(mesh), 0)

    def check_colors(self, mesh, grid):
        """The cell behind the middle of each triangle is a voxel of the colour of its corners."""
        corners = (mesh.points[mesh.triangles()] - grid["origin"]) / grid["voxel_size"]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        # Not the centre of gravity, which may lie between two cells.
        inner = np.einsum("tcx,c->tx", corners, [0.61, 0.28, 0.11])
        x, y, z = np.floor(inner - 0.5 * normals).astype(int).T
        self.assertTrue(grid["occupancy"][z, y, x].all())
        wanted = grid["color"][z, y, x] / 255
        for corner in mesh.triangles().T:
            np.testing.assert_allclose(mesh.colors[corner, :3], wanted[:, :3], atol=2e-3 / 3)

    def test_faces_and_rectangles_are_the_outer_faces_of_the_voxels_and_closed(self):
        for query in ("size=41", "size=40&fill=solid", "size=60&level=1", "dims=30,40,20&bounds=-1,-1,-1,1,3,1"):
            grid = self.npz(query)
            squares = sum(int(faces.sum()) for faces in self.outer_faces(grid).values())
            for form in READERS:
                faces = self.mesh(query + "&mesh=faces", form)
                self.assertEqual(len(faces.triangles()), 2 * squares)
                greedy = self.mesh(query, form)
                self.assertLess(len(greedy.triangles()), 2 * squares)
                for mesh in (faces, greedy):
                    self.check_faces(mesh, grid)
                    self.check_colors(mesh, grid)

    def test_a_mesh_of_one_colour_has_few_rectangles(self):
        query = "size=48&fill=solid&color=none&channels=occupancy"
        grid = self.npz(query)
        for form in READERS:
            greedy, faces = self.mesh(query, form), self.mesh(query + "&mesh=faces", form)
            self.assertIsNone(greedy.colors)
            self.check_faces(greedy, grid)
            self.assertLess(len(greedy.points), 0.6 * len(faces.points))

    def test_ids_give_colours_where_there_are_none(self):
        query = "size=32&color=none&channels=occupancy,label&labels=node"
        response = self.voxelize(query + "&format=ply")
        self.assertEqual(response.headers["X-Voxeld-Warnings"], "lost-channels")
        self.assertGreater(len(np.unique(READERS["ply"](response.body).colors, axis=0)), 1)

    def test_smooth_meshes_are_closed_and_near_the_voxels(self):
        query = "size=40&fill=solid"
        grid = self.npz(query)
        voxels = int(grid["occupancy"].sum()) * np.prod(grid["voxel_size"])
        for more in ("", "&channels=occupancy,color,distance", "&channels=occupancy,color,coverage"):
            for form in READERS:
                mesh = self.mesh(f"{query}{more}&mesh=smooth", form)
                self.assertEqual(unmatched_edges(mesh), 0)
                # Surface voxels are about half inside, and the rocket's thin fins have no others.
                self.assertTrue(0.5 * voxels < mesh.volume() < voxels, (more, mesh.volume(), voxels))
                np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
                low, high = grid["origin"], grid["origin"] + np.array(grid["occupancy"].shape[::-1]) * grid["voxel_size"]
                self.assertTrue((mesh.points >= low - 1e-6).all() and (mesh.points <= high + 1e-6).all())

    def test_a_mesh_that_is_voxelized_again_gives_the_same_grid(self):
        """Cells whose centres the mesh encloses, by this daemon's own sign."""
        query = "size=40&fill=solid"
        grid = self.npz(query + "&color=none")
        nz, ny, nx = grid["occupancy"].shape
        box = [*grid["origin"], *(grid["origin"] + np.array([nx, ny, nz]) * grid["voxel_size"])]
        again = (f"dims={nx},{ny},{nz}&bounds={','.join(repr(float(v)) for v in box)}&fill=solid&rule=none"
                 "&sign=parity&format=npz&color=none")
        for form in READERS:
            for surface in ("faces", "greedy"):
                body = self.voxelize(f"{query}&format={form}&mesh={surface}").body
                response = self.daemon.post(f"/v1/voxelize?{again}&filename=again.{form}", body)
                self.assertEqual(response.status, 200, response.body)
                same = np.load(io.BytesIO(response.body))["occupancy"] == grid["occupancy"]
                self.assertTrue(same.all(), (form, surface, int((~same).sum())))

    def test_equal_requests_give_equal_bytes(self):
        for form in READERS:
            surfaces = ("faces", "greedy", "smooth")
            more = ("instances", "greedy&compress=meshopt", "smooth&compress=meshopt")
            for surface in surfaces + (more if form == "glb" else ()):
                query = f"size=70&format={form}&mesh={surface}&cache=no"
                self.assertEqual(self.voxelize(query).body, self.voxelize(query).body)

    def test_place_units_and_transform_are_in_the_file(self):
        turn = "transform=0,-2,0,0.5,2,0,0,0,0,0,2,0,0,0,0,1"
        query = f"size=24&units=mm&{turn}"
        grid = self.npz(query)
        for form in ("ply", "obj"):
            comments = self.mesh(query, form).comments
            numbers = number_lists(comments)
            self.assertEqual(numbers["dims"], list(grid["occupancy"].shape[::-1]))
            self.assertEqual(numbers["origin"], list(grid["origin"]))
            self.assertEqual(numbers["voxel_size"], list(grid["voxel_size"]))
            self.assertIn("units mm", comments)
            self.assertIn("transform", [line.split()[0] for line in comments])
        response = self.voxelize(query + "&format=glb")
        self.assertEqual(response.headers["X-Voxeld-Warnings"], "not-metres")
        document = Glb(response.body).document
        extras = document["scenes"][0]["extras"]
        self.assertEqual(extras["meta"]["units"], "mm")
        self.assertEqual(extras["meta"]["options"]["transform"], [float(n) for n in turn.split("=")[1].split(",")])
        self.assertEqual((extras["origin"], extras["voxel_size"]), (list(grid["origin"]), list(grid["voxel_size"])))
        self.assertEqual(document["nodes"][0]["translation"], list(grid["origin"]))

    def test_positions_far_from_the_origin_are_doubles(self):
        far = "transform=1,0,0,3e7,0,1,0,0,0,0,1,0,0,0,0,1"
        grid = self.npz(f"size=24&{far}")
        for form in READERS:
            self.check_faces(self.mesh(f"size=24&{far}", form), grid, tolerance=1e-4)
        body = self.voxelize(f"size=24&{far}&format=ply").body
        self.assertIn(b"property double x\n", body)
        self.assertIn(b"property float x\n", self.voxelize("size=24&format=ply").body)

    def test_frames_are_a_zip_of_meshes(self):
        query = "animation=walk&size=40"
        frames = self.npz(query, "worm.md5.zip")
        for form, read in READERS.items():
            response = self.voxelize(f"{query}&format={form}", "worm.md5.zip")
            self.assertEqual(response.headers["Content-Type"], "application/zip")
            archive = zipfile.ZipFile(io.BytesIO(response.body))
            self.assertEqual(archive.namelist(), [f"frame-{i:04}.{form}" for i in range(6)])
            for i in range(6):
                grid = {"occupancy": frames["occupancy"][i], "origin": frames["origin"],
                        "voxel_size": frames["voxel_size"]}
                self.check_faces(read(archive.read(f"frame-{i:04}.{form}")), grid)

    def test_an_empty_grid_is_a_mesh_without_faces(self):
        away = "size=8&bounds=100,100,100,101,101,101"
        for form in READERS:
            self.assertEqual(len(self.mesh(away, form).points), 0)

    def test_transparency_is_kept_or_told(self):
        ply = (b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
               b"property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n"
               b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
               b"0 0 0 200 10 10 128\n1 0 0 200 10 10 128\n0 1 0 200 10 10 128\n3 0 1 2\n")
        instances = self.daemon.post("/v1/voxelize?size=8&format=glb&mesh=instances&filename=a.ply", ply)
        self.assertEqual(instances.headers.get("X-Voxeld-Warnings"), "lost-alpha")
        for form, warnings in (("ply", None), ("glb", None), ("obj", "lost-alpha")):
            response = self.daemon.post(f"/v1/voxelize?size=8&format={form}&filename=a.ply", ply)
            self.assertEqual(response.status, 200, response.body)
            self.assertEqual(response.headers.get("X-Voxeld-Warnings"), warnings)
            mesh = READERS[form](response.body)
            if form != "obj":
                np.testing.assert_allclose(mesh.colors[:, 3], 128 / 255, atol=1e-4)
            if form == "glb":
                self.assertEqual(Glb(response.body).document["materials"][0]["alphaMode"], "BLEND")

    def test_accept_and_results_in_other_formats_take_the_mesh(self):
        body = self.fixture("sample.glb")
        faces = self.voxelize("size=24&format=glb&mesh=faces").body
        accept = {"Accept": "model/gltf-binary"}
        response = self.daemon.request("POST", "/v1/voxelize?size=24&mesh=faces&filename=sample.glb", body, accept)
        self.assertEqual((response.status, response.body == faces), (200, True))
        job = self.voxelize("size=24").headers["X-Voxeld-Job"]
        for path, headers in ((f"/v1/jobs/{job}/result?format=glb&mesh=faces", {}),
                              (f"/v1/jobs/{job}/result?mesh=faces", accept)):
            response = self.daemon.request("GET", path, None, headers)
            self.assertEqual(response.headers["Content-Type"], "model/gltf-binary")
            self.assertEqual(response.body, faces)

    def test_mesh_without_a_format_of_meshes_is_refused(self):
        for query, name, expected, got in (
                ("format=vox&mesh=faces", "mesh", "format glb, ply or obj with it", "vox"),
                ("mesh=greedy", "mesh", "format glb, ply or obj with it", "native"),
                ("format=obj&mesh=instances", "mesh", "format glb with instances", "obj"),
                ("format=ply&compress=meshopt", "compress", "format glb with it", "ply")):
            response = self.daemon.post("/v1/voxelize?filename=sample.glb&" + query, self.fixture("sample.glb"))
            problem = json.loads(response.body)
            self.assertEqual((response.status, problem["detail"], problem["expected"], problem["got"]),
                             (400, name, expected, f'"{got}"'))
