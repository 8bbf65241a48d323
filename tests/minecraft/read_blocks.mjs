// Reads each file of blocks that a line of the input names by others' programs, and prints what each found, as a line
// of JSON:
//   nbt        prismarine-nbt: names of the root's members, and the bytes of the file that it read
//   schematic  prismarine-schematic, of a version 2 .schem: size, version of the game, names, and the index of each
//              cell's name in the order y, z, x as base64
import fs from "node:fs";
import { createInterface } from "node:readline";
import zlib from "node:zlib";
import nbt from "prismarine-nbt";
import schematics from "prismarine-schematic";
import prismarineBlock from "prismarine-block";
import vec3 from "vec3";

function readTags(bytes) {
  const raw = zlib.gunzipSync(bytes);
  const tags = nbt.protos.big.parsePacketBuffer("nbt", raw);
  return { root: tags.data.name, members: Object.keys(tags.data.value), read: tags.metadata.size, bytes: raw.length };
}

async function readSchematic(bytes) {
  const schematic = await schematics.Schematic.read(bytes);
  const Block = prismarineBlock(schematic.version);
  const { x: width, y: height, z: length } = schematic.size;
  const names = [], numbers = new Map();
  const cells = Buffer.alloc(width * height * length);
  let at = 0;
  for (let y = 0; y < height; ++y) {
    for (let z = 0; z < length; ++z) {
      for (let x = 0; x < width; ++x) {
        const state = schematic.getBlockStateId(schematic.start().offset(x, y, z));
        if (!numbers.has(state)) {
          numbers.set(state, names.length);
          names.push(Block.fromStateId(state, 0).name);
        }
        cells[at++] = numbers.get(state);
      }
    }
  }
  return { size: [width, height, length], version: schematic.version, names, cells: cells.toString("base64"),
           start: schematic.start().equals(new vec3.Vec3(0, 0, 0)) };
}

for await (const line of createInterface({ input: process.stdin })) {
  const [path, what] = JSON.parse(line);
  const bytes = fs.readFileSync(path);
  console.log(JSON.stringify({
    nbt: readTags(bytes),
    schematic: what === "schematic" ? await readSchematic(bytes) : null,
  }));
}
