// The tables are those of server/render, word by word.
import assert from "node:assert/strict";
import { test } from "node:test";
import { packGrid } from "../../../client/web/view/pack/packer";
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
