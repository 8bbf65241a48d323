"""Assets: deduplicated uploads and their description."""
import json
import unittest
import zipfile

from harness import DATA, DaemonTest


class Assets(DaemonTest):
    def test_the_same_bytes_are_one_asset(self):
        first = self.daemon.post("/v1/assets?filename=a.ply", self.fixture("sample.ply"))
        second = self.daemon.post("/v1/assets?filename=a.ply", self.fixture("sample.ply"))
        self.assertEqual((first.status, second.status), (201, 200))
        self.assertEqual(first.json()["id"], second.json()["id"])
        self.assertEqual(first.headers["Location"], "/v1/assets/" + first.json()["id"])

    def test_description_of_a_sample(self):
        asset = self.daemon.upload(self.fixtures / "sample.obj.zip")
        description = self.daemon.get(f"/v1/assets/{asset}").json()
        self.assertGreater(description["triangles"], 100)
        for corner in ("min", "max"):
            self.assertEqual(len(description["bounds"][corner]), 3)
        self.assertTrue(description["materials"])
        self.assertEqual(description["missing_files"], [])

    def upload_bundle(self, files):
        return self.daemon.request(
            "POST", "/v1/assets", body=json.dumps({"files": files}),
            headers={"Content-Type": "application/vnd.voxeld.bundle+json"})

    def test_files_that_were_uploaded_one_by_one_are_as_good_as_a_zip_of_them(self):
        with zipfile.ZipFile(self.fixtures / "worm.md5.zip") as archive:
            files = [{"name": name, "asset": self.daemon.post("/v1/assets", archive.read(name)).json()["id"]}
                     for name in archive.namelist()]
        self.assertGreater(len(files), 2)
        stored = self.upload_bundle(files)
        self.assertEqual(stored.status, 201, stored.body)
        self.assertEqual(self.upload_bundle(files).status, 200)
        bundle, packed = stored.json()["id"], self.daemon.upload(self.fixtures / "worm.md5.zip")
        self.assertTrue(stored.json()["filename"].endswith(".bundle.json"))
        told = [self.daemon.get(f"/v1/assets/{asset}").json() for asset in (bundle, packed)]
        for member in ("format", "triangles", "joints", "animations", "materials", "missing_files"):
            self.assertEqual(told[0][member], told[1][member], member)
        hashes = []
        for asset in (bundle, packed):
            response = self.daemon.post(f"/v1/voxelize?size=24&animation=walk&asset={asset}")
            self.assertEqual(response.status, 200, response.body)
            self.assertEqual(json.loads(response.headers["X-Voxeld-Meta"])["animation"]["name"], "walk")
            frames = self.daemon.get(f"/v1/sequences/{response.headers['X-Voxeld-Sequence']}/frames").json()
            hashes.append([frame["content_hash"] for frame in frames["frames"]])
        self.assertEqual(hashes[0], hashes[1])
        self.assertEqual(len(hashes[0]), 6)

    def test_a_file_is_read_as_its_own_request_says_and_not_as_an_earlier_one(self):
        obj = b"# two names\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
        wrong = self.daemon.post("/v1/voxelize?size=8&filename=a.stl", obj)
        self.assert_problem(wrong, 422, "malformed-mesh")
        self.assertEqual(self.daemon.post("/v1/voxelize?size=8", obj).status, 200)
        self.assertEqual(self.daemon.post("/v1/voxelize?size=8&filename=a.obj", obj).status, 200)
        again = self.daemon.post("/v1/voxelize?size=8&filename=b.stl", obj)
        self.assert_problem(again, 422, "malformed-mesh")

    def test_a_media_type_names_the_format_of_a_file_without_a_name(self):
        obj = b"# a type\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
        for media_type, status in (("model/stl", 422), ("model/obj", 200), ("", 200)):
            response = self.daemon.request("POST", "/v1/voxelize?size=8", body=obj,
                                         headers={"Content-Type": media_type})
            self.assertEqual(response.status, status, media_type)
            if status == 422:
                self.assertEqual(response.json()["code"], "malformed-mesh")

    def test_descriptions_of_the_same_bytes_are_those_of_each_name(self):
        obj = b"# descriptions\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
        ids = {name: self.daemon.post("/v1/assets" + (name and "?filename=" + name), obj).json()["id"]
               for name in ("a.stl", "a.obj", "")}
        for _ in range(2):  # made, and remembered
            self.assert_problem(self.daemon.get(f"/v1/assets/{ids['a.stl']}"), 422, "malformed-mesh")
            for name in ("a.obj", ""):
                self.assertEqual(self.daemon.get(f"/v1/assets/{ids[name]}").json()["format"], "obj")
        job = self.daemon.post(f"/v1/voxelize?size=8&asset={ids['a.obj']}")
        self.assertEqual(job.status, 200, job.body)

    def test_missing_files_are_named(self):
        obj = b"mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
        asset = self.daemon.post("/v1/assets?filename=a.obj", obj).json()["id"]
        description = self.daemon.get(f"/v1/assets/{asset}").json()
        self.assertIn("gone.mtl", json.dumps(description["missing_files"]))

    def test_a_broken_asset_reports_its_error_on_inspection(self):
        asset = self.daemon.post("/v1/assets?filename=a.obj", b"v 1 2\nf 1 2 3\n").json()["id"]
        self.assert_problem(self.daemon.get(f"/v1/assets/{asset}"), 422, "malformed-mesh", "line 1")

    @unittest.skipUnless(DATA, "VOXELD_DATA_DIR is not set: no real meshes")
    def test_real_meshes_have_the_counts_of_their_manifest(self):
        for name, triangles in {"scans/bunny/bun_zipper.ply": 69451, "scans/bunny/bunny.OBJ": 5110,
                                "scans/buddha/buddha_100k.obj": 100000, "gltf/Duck.glb": 4212,
                                "scans/bunny/bunny_69451.stl": 69451,
                                "obj/spot/spot_quadrangulated.obj": 5856}.items():
            with self.subTest(name):
                asset = self.daemon.upload(f"{DATA}/{name}")
                self.assertEqual(self.daemon.get(f"/v1/assets/{asset}").json()["triangles"], triangles)


if __name__ == "__main__":
    unittest.main()
