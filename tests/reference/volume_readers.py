"""Readers of volumes, points and Qubicle files, written from their specifications, with numpy and zlib alone.

Arrays have the shape (nz, ny, nx) or (nz, ny, nx, components). Places are float64, in the file's units."""
import gzip
import re
import struct
import xml.etree.ElementTree as ElementTree
import zlib

import numpy as np


class Volume:
    """arrays: name -> array; origin, spacing: of x, y, z; centered: whether origin is the first cell's centre;
    fields: texts that the file holds beside the arrays."""

    def __init__(self, arrays, origin, spacing, centered, fields):
        self.arrays, self.fields, self.centered = arrays, fields, centered
        self.origin, self.spacing = np.array(origin, float), np.array(spacing, float)

    def corner(self):
        return self.origin - self.spacing / 2 if self.centered else self.origin


VTK_TYPES = {"UInt8": "u1", "Int8": "i1", "UInt16": "<u2", "Float32": "<f4"}


def vtk_blocks(data, at):
    """The bytes of an array in VTK's blocks of zlib streams, with a UInt64 header."""
    blocks, block_bytes, last_bytes = struct.unpack_from("<3Q", data, at)
    lengths = struct.unpack_from(f"<{blocks}Q", data, at + 24)
    at += 24 + 8 * blocks
    parts = []
    for number, length in enumerate(lengths):
        parts.append(zlib.decompress(data[at:at + length]))
        is_last = number == blocks - 1
        assert len(parts[-1]) == (last_bytes if is_last and last_bytes else block_bytes)
        at += length
    return b"".join(parts)


def read_vti(data):
    marker = b'<AppendedData encoding="raw">\n_'
    begin = data.index(marker) + len(marker)
    assert data.endswith(b"\n  </AppendedData>\n</VTKFile>\n")
    root = ElementTree.fromstring(data[:begin] + b"</AppendedData></VTKFile>")
    assert (root.get("type"), root.get("byte_order"), root.get("header_type"), root.get("compressor")) == (
        "ImageData", "LittleEndian", "UInt64", "vtkZLibDataCompressor")
    image = root.find("ImageData")
    x0, x1, y0, y1, z0, z1 = map(int, image.get("WholeExtent").split())
    assert (x0, y0, z0) == (0, 0, 0) and image.find("Piece").get("Extent") == image.get("WholeExtent")
    arrays = {}
    for node in image.find("Piece/CellData"):
        assert node.get("format") == "appended"
        samples = np.frombuffer(vtk_blocks(data, begin + int(node.get("offset"))), VTK_TYPES[node.get("type")])
        components = int(node.get("NumberOfComponents"))
        arrays[node.get("Name")] = samples.reshape((z1, y1, x1) + ((components,) if components > 1 else ()))
    fields = {}
    for node in image.find("FieldData"):
        texts = vtk_blocks(data, begin + int(node.get("offset"))).decode().split("\0")
        assert texts.pop() == "" and len(texts) == int(node.get("NumberOfTuples"))
        fields[node.get("Name")] = texts
    place = [[float(number) for number in image.get(name).split()] for name in ("Origin", "Spacing")]
    return Volume(arrays, *place, False, fields)


NRRD_TYPES = {"uint8": "u1", "int8": "i1", "uint16": "<u2", "float": "<f4"}


def read_nrrd(data):
    head, body = data.split(b"\n\n", 1)
    lines = head.decode().split("\n")
    assert lines[0] == "NRRD0004"
    fields, pairs = {}, {}
    for line in lines[1:]:
        if line.startswith("#"):
            continue
        key, separator, value = re.match(r"([^:]+):([=: ])(.*)", line).groups()
        if separator == "=":
            pairs[key] = re.sub(r"\\(.)", lambda match: "\n" if match[1] == "n" else match[1], value)
        else:
            fields[key] = value
    assert fields["encoding"] == "gzip" and fields["space"] == "3D-right-handed"
    sizes = [int(size) for size in fields["sizes"].split()]
    assert len(sizes) == int(fields["dimension"]) == len(fields["kinds"].split())
    directions = [word for word in fields["space directions"].split() if word != "none"]
    matrix = np.array([[float(n) for n in word.strip("()").split(",")] for word in directions])
    assert (matrix == np.diag(np.diag(matrix))).all()
    origin = [float(n) for n in fields["space origin"].strip("()").split(",")]
    samples = np.frombuffer(gzip.decompress(body), NRRD_TYPES[fields["type"]])
    components = sizes[:-3]
    shape = [*sizes[:-4:-1], *components]
    return Volume({fields["content"]: samples.reshape(shape)}, origin, np.diag(matrix), True, {**fields, **pairs})


MHA_TYPES = {"MET_UCHAR": "u1", "MET_CHAR": "i1", "MET_USHORT": "<u2", "MET_FLOAT": "<f4"}


def read_mha(data):
    end = b"ElementDataFile = LOCAL\n"
    begin = data.index(end) + len(end)
    fields = dict(line.split(" = ", 1) for line in data[:begin].decode().splitlines())
    assert fields["CompressedData"] == "True" and fields["BinaryDataByteOrderMSB"] == "False"
    assert int(fields["CompressedDataSize"]) == len(data) - begin
    assert fields["TransformMatrix"] == "1 0 0 0 1 0 0 0 1"
    nx, ny, nz = map(int, fields["DimSize"].split())
    components = int(fields["ElementNumberOfChannels"])
    samples = np.frombuffer(zlib.decompress(data[begin:]), MHA_TYPES[fields["ElementType"]])
    shape = (nz, ny, nx) + ((components,) if components > 1 else ())
    place = [[float(n) for n in fields[name].split()] for name in ("Offset", "ElementSpacing")]
    return Volume({fields["Comment"].split()[1]: samples.reshape(shape)}, *place, True, fields)


NIFTI_TYPES = {2: "u1", 16: "<f4", 256: "i1", 512: "<u2", 2304: "u1"}


def read_nii(data):
    data = gzip.decompress(data)
    size, = struct.unpack_from("<i", data)
    assert size == 348 and data[344:348] == b"n+1\0"
    axes, nx, ny, nz, nt, nv, _, _ = struct.unpack_from("<8h", data, 40)
    intent, code, bits = struct.unpack_from("<3h", data, 68)
    begin, slope, inter = struct.unpack_from("<3f", data, 108)
    rows = np.array(struct.unpack_from("<12f", data, 280)).reshape(3, 4)
    assert struct.unpack_from("<2h", data, 252) == (2, 2) and (axes, nt) in ((3, 1), (5, 1))
    assert tuple(rows[:, 3]) == struct.unpack_from("<3f", data, 268)
    assert tuple(np.diag(rows)) == struct.unpack_from("<3f", data, 80)
    samples = np.frombuffer(data[int(begin):], NIFTI_TYPES[code])
    if code == 2304:
        array = samples.reshape(nz, ny, nx, 4)
    else:
        array = samples.reshape(nv, nz, ny, nx).transpose(1, 2, 3, 0)
        array = array[..., 0] if axes == 3 else array
    assert bits == 8 * samples.itemsize * (4 if code == 2304 else 1)
    length, kind = struct.unpack_from("<2i", data, 352)
    assert data[348] == 1 and kind == 6 and 352 + length == begin
    fields = {"intent": intent, "units": data[123], "slope": slope, "meta": data[360:352 + length].rstrip(b"\0").decode()}
    name = data[328:344].rstrip(b"\0").decode()
    return Volume({name: array}, rows[:, 3], np.diag(rows), True, fields)


def read_binvox(data):
    head, body = data.split(b"data\n", 1)
    lines = head.decode().splitlines()
    assert lines[0] == "#binvox 1"
    words = {line.split()[0]: [float(n) for n in line.split()[1:]] for line in lines[1:]}
    depth, height, width = map(int, words["dim"])
    assert depth == height == width
    runs = np.frombuffer(body, np.uint8).reshape(-1, 2)
    assert (runs[:, 1] > 0).all()
    cells = np.repeat(runs[:, 0], runs[:, 1]).reshape(depth, width, height)  # x, z, y
    return Volume({"occupancy": cells.transpose(1, 2, 0)}, words["translate"],
                  [words["scale"][0] / depth] * 3, False, {})


def read_csv(data):
    """Columns by name, as float64."""
    head, body = data.decode().split("\n", 1)
    rows = np.array([[float(word) for word in line.split(",")] for line in body.splitlines()])
    names = head.split(",")
    return {name: rows.reshape(-1, len(names))[:, number] for number, name in enumerate(names)}


def read_pcd(data):
    """Columns by name, in their types, and the comments."""
    end = b"DATA binary\n"
    begin = data.index(end) + len(end)
    lines = data[:begin].decode().splitlines()
    comments = [line[2:] for line in lines if line.startswith("# ")]
    words = {line.split()[0]: line.split()[1:] for line in lines if not line.startswith("#")}
    assert words["VERSION"] == ["0.7"] and set(words["COUNT"]) == {"1"}
    types = [(name, f"<{kind.lower()}{size}") for name, kind, size in zip(words["FIELDS"], words["TYPE"], words["SIZE"])]
    points = np.frombuffer(data[begin:], types)
    assert [str(len(points))] == words["POINTS"] == words["WIDTH"] and words["HEIGHT"] == ["1"]
    return points, comments


def read_qb(data):
    """Cells (x, y, z) and their RGBA."""
    assert struct.unpack_from("<I4I", data) == (0x101, 0, 0, 1, 0)
    matrices, = struct.unpack_from("<I", data, 20)
    at, cells, colors = 24, [], []
    for _ in range(matrices):
        at += 1 + data[at]
        nx, ny, nz, px, py, pz = struct.unpack_from("<3I3i", data, at)
        at += 24
        for z in range(nz):
            plane = []
            while (code := struct.unpack_from("<I", data, at)[0]) != 6:
                if code == 2:
                    count, color = struct.unpack_from("<2I", data, at + 4)
                    plane.append(np.full(count, color, np.uint32))
                    at += 12
                else:
                    plane.append(np.array([code], np.uint32))
                    at += 4
            at += 4
            plane = np.concatenate(plane).reshape(ny, nx)
            y, x = np.nonzero(plane)
            cells.append(np.stack([px + x, py + y, np.full(len(x), pz + z)], 1))
            colors.append(plane[y, x].astype("<u4").view(np.uint8).reshape(-1, 4))
    assert at == len(data)
    return np.concatenate(cells), np.concatenate(colors)
