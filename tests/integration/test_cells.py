"""Meshes of hexahedra (vtu, inp), read by VTK and meshio and compared with the npz of the same grid."""
import base64
import io
import json
import pathlib
import tempfile
import unittest.mock
import zipfile

import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from harness import DaemonTest

SURFACE = "size=61&channels=color,normal,label&labels=material"
SOLID = "size=48&fill=solid&channels=color,material,coverage"
BAND = "size=40&fill=band"
PLACES = ("", "&level=1", "&region=10,5,3,36,17,18", "&region=10,5,3,36,17,18&level=1")
# The corners of a cell in the order of VTK_HEXAHEDRON and C3D8.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


class VtuFile:
    """A .vtu as VTK reads it."""

    def __init__(self, data):
        with tempfile.NamedTemporaryFile(suffix=".vtu") as file:
            file.write(data)
            file.flush()
            reader = vtk.vtkXMLUnstructuredGridReader()
            reader.SetFileName(file.name)
            reader.Update()
            assert reader.GetErrorCode() == 0
            self.grid = reader.GetOutput()
        self.points = vtk_to_numpy(self.grid.GetPoints().GetData())
        self.cells = vtk_to_numpy(self.grid.GetCells().GetConnectivityArray()).reshape(-1, 8)
        self.arrays = self.read(self.grid.GetCellData())
        self.fields = self.read(self.grid.GetFieldData())

    @staticmethod
    def read(data):
        return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}

    def text(self, name):
        return bytes(self.fields[name]).decode()

    def volumes(self):
        quality = vtk.vtkMeshQuality()
        quality.SetInputData(self.grid)
        quality.SetHexQualityMeasureToVolume()
        quality.Update()
        return vtk_to_numpy(quality.GetOutput().GetCellData().GetArray("Quality"))


def decode_to_padding(text, *_):
    """base64.b64decode as it was before Python 3.13, and as meshio needs it to read one of several arrays in a row."""
    end = text.find("=" if isinstance(text, str) else b"=")
    return base64_decode(text if end < 0 else text[:(end + 3) // 4 * 4])


base64_decode = base64.b64decode


def read_with_meshio(data, extension):
    with tempfile.TemporaryDirectory() as directory, unittest.mock.patch("base64.b64decode", decode_to_padding):
        path = pathlib.Path(directory) / ("mesh" + extension)
        path.write_bytes(data)
        return meshio.read(path)


class Cells(DaemonTest):
    def voxelize(self, query, name="sample.obj.zip"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query, name="sample.obj.zip"):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz&layout=sparse", name).body))

    def check_mesh(self, grid, points, cells, atol):
        """Each voxel's 8 corners, and one point for each corner that a voxel has."""
        lattice = grid["coords"][:, None, :] + CORNERS
        self.assertEqual(cells.shape, (len(grid["coords"]), 8))
        np.testing.assert_allclose(points[cells], grid["origin"] + lattice * grid["voxel_size"], rtol=0, atol=atol)
        touched = np.unique(lattice.reshape(-1, 3), axis=0)
        self.assertEqual(len(points), len(touched))
        self.assertEqual(len(np.unique(cells)), len(points))

    def check_values(self, grid, arrays):
        channels = [name for name in grid.files if name not in ("coords", "dims", "origin", "voxel_size", "meta")]
        self.assertEqual(sorted(arrays), sorted(channels + ["cell"]))
        self.assertTrue((arrays["cell"] == grid["coords"]).all())
        for name in channels:
            wanted = grid[name]
            if name == "distance" and len(set(grid["voxel_size"].tolist())) == 1:
                wanted = (wanted.astype(float) * grid["voxel_size"][0]).astype(np.float32)
            self.assertEqual((arrays[name].shape, arrays[name].dtype), (wanted.shape, wanted.dtype), name)
            self.assertTrue((arrays[name] == wanted).all(), name)

    def check_vtu(self, query):
        grid = self.npz(query)
        file = VtuFile(self.voxelize(query + "&units=mm&format=vtu").body)
        self.check_mesh(grid, file.points, file.cells, 1e-6)
        self.check_values(grid, file.arrays)
        types = vtk_to_numpy(file.grid.GetCellTypesArray())
        self.assertEqual(set(types.tolist()), {vtk.VTK_HEXAHEDRON})
        volumes = file.volumes()
        self.assertTrue((volumes > 0).all())
        np.testing.assert_allclose(volumes, np.prod(grid["voxel_size"]), rtol=1e-3)
        for name in ("origin", "voxel_size"):
            self.assertTrue((file.fields[name].ravel() == grid[name]).all(), name)
        self.assertEqual((file.text("units"), file.text("up")), ("mm", "y"))
        meta = json.loads(file.text("meta"))
        self.assertEqual(meta["dims"], file.fields["dims"].ravel().tolist())

    def test_vtk_reads_the_voxels_of_a_vtu_with_every_channel(self):
        for query in (SURFACE, SOLID, BAND):
            for place in PLACES + ("&dtype=float32",) if query != BAND else PLACES:
                with self.subTest(query=query, place=place):
                    self.check_vtu(query + place)
        file = VtuFile(self.voxelize(SURFACE + "&format=vtu").body)
        self.assertEqual(file.text("labels"), "\0brick wall\0wood\0roof tiles\0leaves\0")

    def test_voxels_of_three_tiles_and_of_full_nodes(self):
        self.check_vtu("size=300&channels=color")
        self.check_vtu("size=100&fill=solid&channels=occupancy")

    def test_voxels_that_are_no_cubes(self):
        self.check_vtu("dims=20,30,16&bounds=-1,-1,-1,1,3,1&channels=color,distance")

    def test_meshio_reads_a_vtu(self):
        grid = self.npz(SURFACE)
        mesh = read_with_meshio(self.voxelize(SURFACE + "&format=vtu").body, ".vtu")
        self.assertEqual([block.type for block in mesh.cells], ["hexahedron"])
        self.check_mesh(grid, mesh.points, mesh.cells[0].data, 1e-6)
        self.check_values(grid, {name: blocks[0] for name, blocks in mesh.cell_data.items()})
        self.assertEqual(json.loads(bytes(mesh.field_data["meta"]))["channels"],
                         ["occupancy", "color", "normal", "label"])

    def check_inp(self, query, ids=None, names=()):
        """ids: the channel that gives sets; names: of ids 1, 2 and so on."""
        grid = self.npz(query)
        mesh = read_with_meshio(self.voxelize(query + "&format=inp").body, ".inp")
        self.assertEqual([block.type for block in mesh.cells], ["hexahedron"])
        self.check_mesh(grid, mesh.points, mesh.cells[0].data, 1e-12)
        corners = mesh.points[mesh.cells[0].data]
        edges = corners[:, [1, 3, 4]] - corners[:, [0]]
        np.testing.assert_allclose(np.linalg.det(edges), np.prod(grid["voxel_size"]), rtol=1e-6)
        count = len(grid["coords"])
        wanted = {"voxels": list(range(count))}
        for number in (np.unique(grid[ids]) if ids else []):
            if number > 0:
                name = names[number - 1] if number <= len(names) else f"{ids}_{number}"
                wanted[name] = np.nonzero(grid[ids] == number)[0].tolist()
        self.assertEqual({name: blocks[0].tolist() for name, blocks in mesh.cell_sets.items()}, wanted)

    def test_meshio_reads_the_voxels_of_an_inp_and_its_sets(self):
        names = ("brick_wall", "wood", "roof_tiles", "leaves")
        for place in PLACES:
            with self.subTest(place=place):
                self.check_inp(SURFACE + place, "label", names)
                self.check_inp(SOLID + place, "material", names)
                self.check_inp(BAND + place)

    def test_an_inp_says_where_it_lies(self):
        text = self.voxelize("size=20&units=mm&transform=2,0,0,1,0,2,0,0,0,0,2,0,0,0,0,1&format=inp").body.decode()
        head = text[:text.index("*NODE")]
        for line in ("dims ", "origin ", "voxel_size ", "units mm\n", "transform [2"):
            self.assertIn("\n** " + line, head)

    def test_frames_are_a_zip_of_files(self):
        query = "animation=walk&size=24&channels=color"
        for form in ("vtu", "inp"):
            response = self.voxelize(f"{query}&format={form}", "worm.md5.zip")
            self.assertEqual(response.headers["Content-Type"], "application/zip")
            archive = zipfile.ZipFile(io.BytesIO(response.body))
            self.assertEqual(archive.namelist(), [f"frame-{i:04}.{form}" for i in range(6)])
            for name in archive.namelist():
                mesh = read_with_meshio(archive.read(name), "." + form)
                self.assertGreater(len(mesh.cells[0].data), 0)

    def test_equal_requests_give_equal_bytes(self):
        for form in ("vtu", "inp"):
            query = f"{SURFACE}&format={form}&cache=no"
            self.assertEqual(self.voxelize(query).body, self.voxelize(query).body, form)

    def test_media_types(self):
        for form, kind in (("vtu", "application/x-vtu"), ("inp", "application/x-abaqus-inp")):
            self.assertEqual(self.voxelize("size=9&format=" + form).headers["Content-Type"], kind)


if __name__ == "__main__":
    unittest.main()
