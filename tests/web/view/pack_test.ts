// The tables are those of server/render, word by word.
import assert from "node:assert/strict";
import { test } from "node:test";
import { openContainer } from "../../../client/web/view/decode/container";
import { compact, mortonOf } from "../../../client/web/view/decode/morton";
import {
  Octree,
  OCTREE_BYTES_MAX,
  type FullNode,
} from "../../../client/web/view/decode/octree";
import { decompressStream } from "../../../client/web/view/decode/zstd_stream";
import { CHILD, FULL, type PackedGrid } from "../../../client/web/view/pack/packed_grid";
import { packGrid, Packer } from "../../../client/web/view/pack/packer";
import type { Vec3 } from "../../../client/web/view/viewer";
import { containerOf, listed, tablesOf } from "./containers";

/** Compares words, and says where they differ without printing millions of them. */
function sameWords(
  what: string,
  got: ArrayLike<number>,
  expected: ArrayLike<number>,
  padded: boolean,
): void {
  if (padded) assert.ok(got.length >= expected.length, `${what}: ${got.length} words`);
  else assert.equal(got.length, expected.length, what);
  for (let i = 0; i < got.length; ++i) {
    const wanted = i < expected.length ? expected[i]! : 0;
    if (got[i] !== wanted) assert.equal(got[i], wanted, `${what}, word ${i} of ${expected.length}`);
  }
}

const grids = listed().filter((entry) => !entry.small);
assert.ok(grids.length > 20, "the list of containers is complete");
for (const { name } of grids) {
  test(`${name} has the tables of the C++ packer`, () => {
    const grid = packGrid(containerOf(name)),
      cpp = tablesOf(name);
    assert.equal(grid.nodeWords, cpp.nodes.length);
    sameWords("nodes", grid.nodes, cpp.nodes, true);
    sameWords("bricks", grid.bricks, cpp.bricks, true);
    sameWords("colors", grid.paint?.colors ?? [], cpp.colors, true);
    sameWords("normals", grid.attributes.normal ?? [], cpp.normals, true);
    const hull = grid.hull.length > 0 ? grid.hull : [];
    sameWords("hull", hull, cpp.hull, false);
    const full = grid.paint?.fullColor;
    sameWords(
      "facts",
      [...grid.occupiedMin, ...grid.occupiedMax, full ? 1 : 0, ...(full ?? [0, 0, 0])],
      cpp.facts,
      false,
    );
    assert.equal(grid.paint?.luminance ?? 1, cpp.luminance);
  });
}

/** Calls `found` with the first cell and the side of each voxel and full node. */
function eachNode(bytes: Uint8Array, found: (cell: Vec3, side: number) => void): void {
  for (const tile of openContainer(bytes).tiles) {
    const octree = new Octree(decompressStream(tile.octree, OCTREE_BYTES_MAX));
    const full: FullNode[] = [],
      masks = new Uint8Array(64 * octree.bricks);
    const at = (code: number, side: number): Vec3 => [
      256 * tile.coord[0] + side * compact(code),
      256 * tile.coord[1] + side * compact(code >> 1),
      256 * tile.coord[2] + side * compact(code >> 2),
    ];
    octree.read(masks, 0, 64, full).forEach((code, brick) => {
      for (let i = 0; i < 512; ++i)
        if ((masks[64 * brick + (i >> 3)]! & (1 << (i & 7))) !== 0) found(at(512 * code + i, 1), 1);
    });
    for (const node of full) found(at(node.code, 8), 8 << node.level);
  }
}

/** A brick's entry in the tables. */
function entryOf({ nodes, tileDims }: PackedGrid, x: number, y: number, z: number): number {
  const tile = nodes[(x >> 5) + tileDims[0] * ((y >> 5) + tileDims[1] * (z >> 5))]!;
  if ((tile & CHILD) === 0) return tile;
  const inTile = ((x & 31) >> 2) + 8 * ((y & 31) >> 2) + 64 * ((z & 31) >> 2);
  const block = nodes[(tile & ~CHILD) + inTile]!;
  if ((block & CHILD) === 0) return block;
  return nodes[(block & ~CHILD) + (x & 3) + 4 * (y & 3) + 16 * (z & 3)]!;
}

function packParts(
  parts: readonly Uint8Array[],
  preview?: Uint8Array,
  inner?: Vec3,
): PackedGrid {
  const steps = new Packer(parts, null, preview, inner).run();
  for (;;) {
    const step = steps.next();
    if (step.done) return step.value;
  }
}

for (const preview of ["preview_2", "preview_5", "preview_8"]) {
  test(`${preview} stands for the tiles that are still to come`, () => {
    const begin = containerOf("growing_begin"),
      [done, grown] = [packGrid(begin), packParts([begin], containerOf(preview))];
    const edge = openContainer(containerOf(preview)).voxelSize[0] / grown.voxelSize[0];
    const last = mortonOf(...openContainer(begin).tiles.at(-1)!.coord);
    const [width, height, depth] = grown.dims.map((cells) => Math.ceil(cells / 8)) as [
      number,
      number,
      number,
    ];
    const expected = new Uint8Array(width * height * depth); // 1: a voxel of the preview is in it
    eachNode(containerOf(preview), (cell, side) => {
      const low = cell.map((v) => Math.floor((v * edge) / 8)),
        high = cell.map((v) => Math.ceil(((v + side) * edge) / 8));
      for (let z = low[2]!; z < Math.min(depth, high[2]!); ++z)
        for (let y = low[1]!; y < Math.min(height, high[1]!); ++y)
          for (let x = low[0]!; x < Math.min(width, high[0]!); ++x)
            expected[x + width * (y + height * z)] = 1;
    });
    let coming = 0;
    for (let z = 0; z < depth; ++z) {
      for (let y = 0; y < height; ++y) {
        for (let x = 0; x < width; ++x) {
          const entry = entryOf(grown, x, y, z),
            isDone = mortonOf(x >> 5, y >> 5, z >> 5) <= last;
          if (isDone) {
            const before = entryOf(done, x, y, z);
            if (entry !== before) assert.equal(entry & CHILD, before & CHILD, `${x}, ${y}, ${z}`);
          } else {
            const isFull = (entry & FULL) !== 0;
            coming += isFull ? 1 : 0;
            if (isFull !== (expected[x + width * (y + height * z)] === 1))
              assert.fail(`brick ${x}, ${y}, ${z}: ${isFull ? "full" : "not full"}`);
          }
        }
      }
    }
    assert.ok(coming > 50, `${coming} bricks`);
    sameWords("bricks", grown.bricks, done.bricks, false);
    assert.equal(grown.voxels, done.voxels);
    grown.occupiedMax.forEach((end, c) => assert.ok(end <= grown.dims[c]!));
  });
}

test("the tiles of all parts are the grid", () => {
  const parts = ["growing_begin", "growing_end"].map(containerOf),
    whole = packGrid(containerOf("growing"));
  assert.deepEqual(packParts(parts), whole);
  assert.deepEqual(packParts(parts, containerOf("preview_8")).bricks, whole.bricks);
});

test("voxels of a part that have no colour get that of the whole", () => {
  const inner: Vec3 = [1, 2, 3],
    { attributes, attributeCount, paint } = packParts([containerOf("half_colored")], undefined, inner);
  const own = attributes.color!.subarray(0, attributeCount);
  assert.ok(own.includes(0) && own.some((color) => color !== 0));
  sameWords(
    "colors",
    paint!.colors.subarray(0, attributeCount),
    own.map((color) => color || 0x030201),
    false,
  );
  assert.deepEqual(paint!.fullColor, inner);
  const full = packParts([containerOf("whole_tile")], undefined, inner);
  assert.deepEqual(full.paint!.fullColor, inner);
});
