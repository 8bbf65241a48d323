"""Zarr stores, as files and served live, by python3-zarr (2 or 3) and by the rules of version 3, against npz."""
import gzip
import io
import json
import tempfile
import unittest
import zipfile
from collections.abc import Mapping

import numpy as np
import zarr

from harness import DaemonTest

GRID = "size=150&channels=color,normal,label&labels=material"
ARRAYS = {"occupancy": "", "color": "color/", "normal": "normal/", "label": "labels/label/"}


class LiveStore(Mapping):
    """The keys below a path of the daemon."""

    def __init__(self, daemon, path):
        self.daemon, self.path = daemon, path

    def __getitem__(self, key):
        response = self.daemon.get(f"{self.path}/{key}")
        if response.status == 404:
            raise KeyError(key)
        assert response.status == 200, response.body
        return response.body

    def __iter__(self):
        return iter(())

    def __len__(self):
        return 0


def open_by_zarr(live):
    """The group of a LiveStore of version 2."""
    if int(zarr.__version__.split(".")[0]) < 3:
        return zarr.open_consolidated(zarr.storage.KVStore(live), mode="r")

    class Store(zarr.storage.MemoryStore):
        async def get(self, key, prototype, byte_range=None):
            assert byte_range is None, byte_range
            return prototype.buffer.from_bytes(live[key]) if key in live else None

    return zarr.open_consolidated(Store(read_only=True), mode="r", zarr_format=2)


def read_v3(store, path):
    """The array at a path of a Zarr 3 store, whose chunks are gzip."""
    array = json.loads(store[path + "/zarr.json"])
    assert array["zarr_format"] == 3 and array["node_type"] == "array", array
    assert array["codecs"][-1]["name"] == "gzip", array
    shape, chunk = array["shape"], array["chunk_grid"]["configuration"]["chunk_shape"]
    dtype = np.dtype(array["data_type"]).newbyteorder("<")
    whole = np.full(shape, array["fill_value"], dtype)
    for place in np.ndindex(*[-(-n // c) for n, c in zip(shape, chunk)]):
        try:
            data = store[f"{path}/c/" + "/".join(map(str, place))]
        except KeyError:
            continue
        cells = np.frombuffer(gzip.decompress(data), dtype).reshape(chunk)
        begin = [p * c for p, c in zip(place, chunk)]
        part = tuple(slice(b, min(b + c, n)) for b, c, n in zip(begin, chunk, shape))
        whole[part] = cells[tuple(slice(0, s.stop - s.start) for s in part)]
    return whole


class Zarr(DaemonTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        name = "sample.obj.zip"
        response = cls.daemon.post(f"/v1/voxelize?{GRID}&format=npz&axes=zyx&filename={name}", (cls.fixtures / name).read_bytes())
        assert response.status == 200, response.body
        cls.grid = cls.daemon.get("/v1/grids").json()["grids"][0]["id"]

    def npz(self, query=""):
        response = self.daemon.get(f"/v1/grids/{self.grid}?format=npz&axes=zyx{query}")
        self.assertEqual(response.status, 200, response.body)
        return np.load(io.BytesIO(response.body))

    def zip_store(self, query=""):
        response = self.daemon.get(f"/v1/grids/{self.grid}?format=zarr{query}")
        self.assertEqual(response.status, 200, response.body)
        self.assertEqual(response.headers["Content-Type"], "application/x-zarr+zip")
        return response.body

    def compare(self, read, query=""):
        levels = 0
        for level in range(3):
            expected = self.npz(f"&level={level}" + query)
            for name, group in ARRAYS.items():
                np.testing.assert_array_equal(read(f"{group}{level}"), expected[name], f"{name} {level}")
                levels += 1
        self.assertEqual(levels, 12)

    def test_zip_of_version_2_is_read_by_zarr(self):
        with tempfile.NamedTemporaryFile(suffix=".zarr.zip") as file:
            file.write(self.zip_store("&zarr_version=2"))
            file.flush()
            store = zarr.storage.ZipStore(file.name, mode="r")
            group = zarr.open_group(store, mode="r")
            self.compare(lambda path: group[path][:])
            self.assertEqual(group.attrs["multiscales"][0]["version"], "0.4")
            store.close()

    def test_zip_of_version_3_equals_npz(self):
        with zipfile.ZipFile(io.BytesIO(self.zip_store())) as archive:
            self.assertEqual({m.compress_type for m in archive.infolist()}, {zipfile.ZIP_STORED})
            self.assertIsNone(archive.testzip())
            self.compare(lambda path: read_v3({name: archive.read(name) for name in archive.namelist()}, path))

    def test_region_is_a_store_of_its_own(self):
        region = "&region=3,5,7,100,67,64"
        with zipfile.ZipFile(io.BytesIO(self.zip_store(region))) as archive:
            store = {name: archive.read(name) for name in archive.namelist()}
        np.testing.assert_array_equal(read_v3(store, "0"), self.npz(region)["occupancy"])
        root = json.loads(store["zarr.json"])["attributes"]["ome"]["multiscales"][0]["datasets"][0]
        scale, move = root["coordinateTransformations"]
        facts = self.daemon.get(f"/v1/grids/{self.grid}/tiles?region=3,5,7,100,67,64").json()
        size, origin = np.array(facts["voxel_size"]), np.array(facts["origin"])
        np.testing.assert_allclose(scale["scale"], size[::-1])
        np.testing.assert_allclose(move["translation"], (origin + size / 2)[::-1])

    def test_the_meta_of_a_changed_grid_is_its_own(self):
        for change in ("region=3,5,7,100,67,64", "level=1", "crop=yes", "erode=1", "remap=1:2,2:1"):
            with self.subTest(change):
                response = self.daemon.get(f"/v1/grids/{self.grid}?format=zarr&{change}")
                with zipfile.ZipFile(io.BytesIO(response.body)) as archive:
                    meta = json.loads(archive.read("zarr.json"))["attributes"]["voxeld"]["meta"]
                other = self.daemon.get(f"/v1/grids/{self.grid}?format=npz&{change}")
                for known in (response.headers["X-Voxeld-Content-Hash"], meta["content_hash"]):
                    self.assertEqual(known, other.headers["X-Voxeld-Content-Hash"])
                other_meta = json.loads(other.headers["X-Voxeld-Meta"])
                for name in ("dims", "origin", "voxel_size", "voxel_count"):
                    self.assertEqual(meta[name], other_meta[name], name)
                occupancy = np.load(io.BytesIO(other.body))["occupancy"]
                self.assertEqual(meta["voxel_count"], np.count_nonzero(occupancy))
                if "remap" in change:
                    names = {label["id"]: label["name"] for label in meta["labels"]}
                    whole = self.daemon.get(f"/v1/grids/{self.grid}?format=zarr")
                    with zipfile.ZipFile(io.BytesIO(whole.body)) as archive:
                        before = json.loads(archive.read("zarr.json"))["attributes"]["voxeld"]["meta"]["labels"]
                    self.assertEqual((names[1], names[2]), (before[1]["name"], before[0]["name"]))

    def test_live_store_of_version_2_is_read_by_zarr(self):
        group = open_by_zarr(LiveStore(self.daemon, f"/v1/grids/{self.grid}/zarr2"))
        self.compare(lambda path: group[path][:])

    def test_live_store_of_version_3_equals_npz(self):
        store = LiveStore(self.daemon, f"/v1/grids/{self.grid}/zarr")
        self.compare(lambda path: read_v3(store, path))

    def test_keys_have_types_validators_and_ranges(self):
        path = f"/v1/grids/{self.grid}/zarr"
        document = self.daemon.get(path + "/zarr.json")
        self.assertEqual(document.headers["Content-Type"], "application/json")
        with zipfile.ZipFile(io.BytesIO(self.zip_store())) as archive:
            name = next(n for n in archive.namelist() if n.startswith("0/c/"))
            chunk = archive.read(name)
        whole = self.daemon.get(f"{path}/{name}")
        self.assertEqual((whole.status, whole.body), (200, chunk))
        self.assertEqual(whole.headers["Content-Type"], "application/octet-stream")
        again = self.daemon.get(f"{path}/{name}", headers={"If-None-Match": whole.headers["ETag"]})
        self.assertEqual(again.status, 304)
        part = self.daemon.get(f"{path}/{name}", headers={"Range": "bytes=2-5"})
        self.assertEqual((part.status, part.body), (206, chunk[2:6]))
        head = self.daemon.request("HEAD", f"{path}/{name}")
        self.assertEqual((head.status, head.headers["Content-Length"]), (200, str(len(chunk))))

    def test_other_keys_are_not_found(self):
        with zipfile.ZipFile(io.BytesIO(self.zip_store())) as archive:
            names = set(archive.namelist())
        empty = next(f"0/c/{z}/{y}/{x}" for z in range(3) for y in range(3) for x in range(3)
                     if f"0/c/{z}/{y}/{x}" not in names)
        for key in (empty, "0/c/9999/0/0", "0/c/00/0/0", "0/c/0/0", "0/c/-1/0/0", "0/c/99999999999999999999/0/0",
                    "0/0/0/0", "9/zarr.json", ".zgroup", "zarr.json/", "a" * 500, "%2e%2e/%2e%2e/x", "0//c/0/0/0"):
            response = self.daemon.get(f"/v1/grids/{self.grid}/zarr/{key}")
            self.assertIn(response.status, (404, 400), key)
        unknown = self.daemon.get(f"/v1/grids/{'0' * 64}/zarr/zarr.json")
        self.assertEqual(unknown.status, 404)
        query = self.daemon.get(f"/v1/grids/{self.grid}/zarr/zarr.json?level=1")
        self.assertEqual(query.status, 400)

    def test_version_needs_the_format(self):
        response = self.daemon.get(f"/v1/grids/{self.grid}?format=npz&zarr_version=2")
        self.assertEqual(response.status, 400)
        self.assertIn("zarr_version", response.json()["detail"])


if __name__ == "__main__":
    unittest.main()
