"""Readers of .schem, .litematic and structure .nbt, written from their specifications, and the blocks that are expected.

    READERS[form](data) -> Blocks: names, and the index of each cell's name in the order z, y, x of an npz
"""
import gzip
import pathlib
import re
import struct
from dataclasses import dataclass

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
AIR = "minecraft:air"
NUMBERS = {1: ">b", 2: ">h", 3: ">i", 4: ">q", 5: ">f", 6: ">d"}
ARRAYS = {7: ">i1", 11: ">i4", 12: ">i8"}


class Nbt:
    """The tags of a file: compounds are dicts, lists lists, arrays arrays of numpy."""

    def __init__(self, data):
        self.data, self.at = data, 0
        assert self.number(1) == 10
        self.name = self.text()
        self.root = self.payload(10)
        assert self.at == len(data), (self.at, len(data))

    def number(self, tag):
        value, = struct.unpack_from(NUMBERS[tag], self.data, self.at)
        self.at += struct.calcsize(NUMBERS[tag])
        return value

    def text(self):
        length, = struct.unpack_from(">H", self.data, self.at)
        self.at += 2 + length
        return self.data[self.at - length:self.at].decode("ascii")

    def payload(self, tag):
        if tag in NUMBERS:
            return self.number(tag)
        if tag == 8:
            return self.text()
        if tag == 9:
            item, count = self.number(1), self.number(3)
            return [self.payload(item) for _ in range(count)]
        if tag in ARRAYS:
            count = self.number(3)
            values = np.frombuffer(self.data, ARRAYS[tag], count, self.at)
            self.at += values.nbytes
            return values
        assert tag == 10, tag
        members = {}
        while (member := self.number(1)) != 0:
            name = self.text()
            assert name not in members, name
            members[name] = self.payload(member)
        return members


@dataclass
class Blocks:
    names: list  # of the palette
    cells: np.ndarray  # z, y, x: indices of names
    tags: dict  # of the file

    def of_cells(self):
        """The name at each cell, without "minecraft:"."""
        return np.array([name.removeprefix("minecraft:") for name in self.names])[self.cells]


def read_tags(data, name=""):
    assert data[:10] == b"\x1f\x8b\x08\0\0\0\0\0\0\xff"
    nbt = Nbt(gzip.decompress(data))
    assert nbt.name == name, nbt.name
    return nbt.root


def varints(data):
    """The numbers of a byte array, each of some bytes with 7 bits."""
    data = data.astype(np.uint8)
    ends = np.flatnonzero(data < 128)
    assert ends[-1] == len(data) - 1
    begins = np.concatenate([[0], ends[:-1] + 1])
    values = np.zeros(len(ends), np.int64)
    for place in range((ends - begins).max() + 1):
        has = begins + place <= ends
        values[has] |= (data[begins[has] + place].astype(np.int64) & 127) << 7 * place
    return values


def from_yzx(indices, size):
    x, y, z = size
    assert len(indices) == x * y * z, (len(indices), size)
    return indices.reshape(y, z, x).transpose(1, 0, 2)


def names_of(palette):
    names = [None] * len(palette)
    for name, index in palette.items():
        names[index] = name
    return names


def read_schem(data, version=2):
    tags = read_tags(data, "Schematic" if version == 2 else "")
    schematic = tags if version == 2 else tags["Schematic"]
    assert schematic["Version"] == version
    holder, key = (schematic, "BlockData") if version == 2 else (schematic["Blocks"], "Data")
    assert holder["BlockEntities"] == []
    names = names_of(holder["Palette"])
    if version == 2:
        assert schematic["PaletteMax"] == len(names)
    size = [schematic[side] & 0xffff for side in ("Width", "Height", "Length")]
    return Blocks(names, from_yzx(varints(holder[key]), size), schematic)


def sides(compound):
    return [compound[axis] for axis in "xyz"]


def read_litematic(data):
    tags = read_tags(data)
    (region,) = tags["Regions"].values()
    names = [state["Name"] for state in region["BlockStatePalette"]]
    assert names[0] == AIR and tags["Version"] == 6 and sides(region["Position"]) == [0, 0, 0]
    size = sides(region["Size"])
    assert sides(tags["Metadata"]["EnclosingSize"]) == size
    count = int(np.prod(size))
    bits = max(2, (len(names) - 1).bit_length())
    longs = region["BlockStates"].astype("<u8")
    assert len(longs) == -(-count * bits // 64)
    stream = np.unpackbits(longs.view(np.uint8), bitorder="little")
    assert not stream[count * bits:].any()
    indices = np.packbits(stream[:count * bits].reshape(count, bits), axis=1, bitorder="little")[:, 0]
    cells = from_yzx(indices.astype(np.int64), size)
    assert tags["Metadata"]["TotalVolume"] == count
    assert tags["Metadata"]["TotalBlocks"] == np.count_nonzero(cells)
    return Blocks(names, cells, tags)


def read_structure(data):
    tags = read_tags(data)
    names = [AIR] + [state["Name"] for state in tags["palette"]]
    x, y, z = tags["size"]
    cells = np.zeros((z, y, x), np.int64)
    for block in tags["blocks"]:
        at = tuple(block["pos"][::-1])
        assert cells[at] == 0, at
        cells[at] = block["state"] + 1
    assert tags["entities"] == []
    return Blocks(names, cells, tags)


READERS = {"schem": read_schem, "schem&schem_version=3": lambda data: read_schem(data, 3),
           "litematic": read_litematic, "nbt": read_structure}


def block_table():
    """Names, groups and colours of all blocks, as the daemon's source lists them."""
    source = (ROOT / "proto/minecraft_blocks.cpp").read_text()
    rows = re.findall(r'\{"(\w+)", "(\w+)", \{(\d+), (\d+), (\d+)\}\}', source)
    assert len(rows) > 127
    return ([row[0] for row in rows], [row[1] for row in rows], np.array([row[2:] for row in rows], np.uint8))


def oklab(colors):
    """OKLab of sRGB colours (…, 3), by the matrices of Ottosson 2020."""
    s = np.asarray(colors) / 255
    linear = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    lms = np.cbrt(linear @ np.array([[0.4122214708, 0.2119034982, 0.0883024619],
                                     [0.5363325363, 0.6806995451, 0.2817188376],
                                     [0.0514459929, 0.1073969566, 0.6299787005]]))
    return lms @ np.array([[0.2104542553, 1.9779984951, 0.0259040371],
                           [0.7936177850, -2.4285922050, 0.7827717662],
                           [-0.0040720468, 0.4505937099, -0.8086757660]])


def distances(colors, table_colors):
    """Distance of each colour (N, 3) to each of the table's: (N, blocks)."""
    return np.linalg.norm(oklab(colors)[:, None] - oklab(table_colors)[None], axis=2)
