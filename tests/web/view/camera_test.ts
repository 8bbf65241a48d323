// Camera, visible cells and the voxel under the pointer.
import assert from "node:assert/strict";
import { test } from "node:test";
import { clipFromWorld, orbited, subjectOf, zoomed } from "../../../client/web/view/camera/framing";
import { apply, inverse, pointOf, times, type Vec4 } from "../../../client/web/view/camera/matrix";
import { visibleCells } from "../../../client/web/view/camera/visible_cells";
import { compact } from "../../../client/web/view/decode/morton";
import { keptCells, raysOf } from "../../../client/web/view/draw/params";
import { packGrid } from "../../../client/web/view/pack/packer";
import {
  BRICK_WORDS,
  CHILD,
  FULL,
  type PackedGrid,
} from "../../../client/web/view/pack/packed_grid";
import { pickVoxel } from "../../../client/web/view/pick";
import type { Camera, Vec3 } from "../../../client/web/view/viewer";
import { containerOf } from "./containers";

const SIZE = { width: 300, height: 200 };
const START: Camera = {
  azimuth: 30,
  elevation: 20,
  zoom: 1,
  pan: [0, 0],
  projection: "perspective",
};
const CAMERAS: readonly Camera[] = [
  START,
  { ...START, projection: "orthographic" },
  { ...START, azimuth: 200, elevation: -60, zoom: 3 },
  { ...START, elevation: 90, pan: [0.3, -0.2] },
  { ...START, azimuth: 90, elevation: 0, projection: "orthographic" },
];

function near(
  got: ArrayLike<number>,
  expected: ArrayLike<number>,
  tolerance: number,
  what: string,
): void {
  for (let i = 0; i < expected.length; ++i) {
    assert.ok(
      Math.abs(got[i]! - expected[i]!) <= tolerance,
      `${what}: ${Array.from(got)} is not ${Array.from(expected)}`,
    );
  }
}

/** The box of cubes that the tables hold: corner and side of each brick's cell and full part. */
function cubesOf(grid: PackedGrid): [Vec3, number][] {
  const cubes: [Vec3, number][] = [],
    { nodes, bricks, tileDims } = grid;
  const visit = (entry: number, low: Vec3, side: number): void => {
    if ((entry & CHILD) === 0) {
      if (entry >= FULL) cubes.push([low, side]);
      return;
    }
    const table = entry & ~CHILD,
      parts = side === 256 ? 8 : 4,
      part = side / parts;
    if (side === 8) {
      for (let i = 0; i < 512; ++i) {
        if (((bricks[table * BRICK_WORDS + (i >> 5)]! >>> (i & 31)) & 1) === 0) continue;
        cubes.push([[low[0] + compact(i), low[1] + compact(i >> 1), low[2] + compact(i >> 2)], 1]);
      }
      return;
    }
    for (let i = 0; i < parts ** 3; ++i) {
      const [x, y, z] = [
        i % parts,
        Math.floor(i / parts) % parts,
        Math.floor(i / parts ** 2),
      ] as const;
      visit(nodes[table + i]!, [low[0] + x * part, low[1] + y * part, low[2] + z * part], part);
    }
  };
  for (let i = 0; i < tileDims[0] * tileDims[1] * tileDims[2]; ++i) {
    const [x, y] = [i % tileDims[0], Math.floor(i / tileDims[0]) % tileDims[1]];
    visit(nodes[i]!, [256 * x!, 256 * y!, 256 * Math.floor(i / (tileDims[0] * tileDims[1]))], 256);
  }
  return cubes;
}

test("a matrix times its inverse is the identity, and singular ones have none", () => {
  const grid = packGrid(containerOf("random_3"));
  for (const camera of CAMERAS) {
    const m = clipFromWorld(camera, subjectOf(grid), SIZE);
    near(times(m, inverse(m)!), [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], 1e-9, "identity");
  }
  assert.equal(inverse(new Array(16).fill(1)), null);
});

test("voxels fill 92% of the width or height, in the middle", () => {
  const grid = packGrid(containerOf("random_3")),
    subject = subjectOf(grid);
  for (const camera of CAMERAS) {
    const m = clipFromWorld({ ...camera, zoom: 1, pan: [0, 0] }, subject, SIZE),
      low = [9, 9],
      high = [-9, -9];
    for (const [p, side] of cubesOf(grid)) {
      for (let i = 0; i < 8; ++i) {
        const cell = (c: 0 | 1 | 2): number => p[c] + (i & (1 << c) ? side : 0);
        const world = (c: 0 | 1 | 2): number => grid.origin[c] + grid.voxelSize[c] * cell(c);
        const at = pointOf(apply(m, world(0), world(1), world(2), 1));
        for (const c of [0, 1] as const) {
          low[c] = Math.min(low[c]!, at[c]);
          high[c] = Math.max(high[c]!, at[c]);
        }
      }
    }
    near(
      [Math.max(high[0]! - low[0]!, high[1]! - low[1]!), low[0]! + high[0]!, low[1]! + high[1]!],
      [1.84, 0, 0],
      1e-9,
      "frame",
    );
  }
});

test("orbiting keeps the middle of the box and its size on the screen", () => {
  const grid = packGrid(containerOf("random_9")),
    subject = subjectOf(grid);
  const middle = (c: 0 | 1 | 2): number => (subject.low[c] + subject.high[c]) / 2;
  for (const camera of CAMERAS) {
    const turned = orbited(camera, subject, SIZE, camera.azimuth + 77, -10);
    assert.equal(turned.azimuth, camera.azimuth + 77);
    const [a, b] = [camera, turned].map((c) =>
      apply(clipFromWorld(c, subject, SIZE), middle(0), middle(1), middle(2), 1),
    ) as [Vec4, Vec4];
    near(pointOf(b), pointOf(a), 1e-9, "middle");
    const [pa, pb] = [camera, turned].map((c) => raysOf(grid, subject, c, SIZE)!.worldPerPixel) as [
      number,
      number,
    ];
    near([pb / pa], [1], 1e-9, "pixel");
    const back = orbited(turned, subject, SIZE, camera.azimuth, camera.elevation);
    near([back.zoom, ...back.pan], [camera.zoom, ...camera.pan], 1e-9, "back");
  }
});

test("zooming keeps the point under the pointer", () => {
  const grid = packGrid(containerOf("random_9")),
    subject = subjectOf(grid);
  for (const camera of CAMERAS) {
    const x = 0.31,
      y = -0.17; // of the height, from the middle
    const m = inverse(clipFromWorld(camera, subject, SIZE))!;
    const world = pointOf(apply(m, (2 * x * SIZE.height) / SIZE.width, 2 * y, 0.1, 1));
    const after = pointOf(
      apply(clipFromWorld(zoomed(camera, camera.zoom * 4, x, y), subject, SIZE), ...world, 1),
    );
    near(after, [(2 * x * SIZE.height) / SIZE.width, 2 * y, 0.1], 1e-9, "point");
  }
});

/** The nearest cube on a ray by a test of each, or null. */
function nearest(
  cubes: readonly [Vec3, number][],
  from: Vec3,
  way: Vec3,
): { t: number; cube: [Vec3, number] } | null {
  let best: { t: number; cube: [Vec3, number] } | null = null;
  for (const cube of cubes) {
    let first = 0,
      last = 1;
    for (const c of [0, 1, 2] as const) {
      const a = (cube[0][c] - from[c]) / way[c],
        b = (cube[0][c] + cube[1] - from[c]) / way[c];
      first = Math.max(first, Math.min(a, b));
      last = Math.min(last, Math.max(a, b));
    }
    if (first <= last && (!best || first < best.t)) best = { t: first, cube };
  }
  return best;
}

for (const name of ["random_9", "random_63", "full_1", "two_tiles", "whole_tile"]) {
  test(`the voxel under the pointer is the nearest one: ${name}`, () => {
    const grid = packGrid(containerOf(name)),
      subject = subjectOf(grid),
      cubes = cubesOf(grid);
    let hits = 0;
    for (const camera of CAMERAS) {
      const rays = raysOf(grid, subject, camera, SIZE)!;
      for (let i = 0; i < 60; ++i) {
        // Rays through voxels, and around them.
        const [low, side] = cubes[(i * 7919) % cubes.length]!,
          off = i % 3 === 0 ? 0.02 * (i % 5) : 1e-4;
        const middle = apply(
          rays.clipFromGrid,
          low[0] + side / 2,
          low[1] + side / 2,
          low[2] + side / 2,
          1,
        );
        const x = middle[0] / middle[3] + off,
          y = middle[1] / middle[3] - off;
        const gridFromClip = inverse(rays.clipFromGrid)!;
        const from = pointOf(apply(gridFromClip, x, y, -1, 1)),
          to = pointOf(apply(gridFromClip, x, y, 1, 1));
        const expected = nearest(cubes, from, [to[0] - from[0], to[1] - from[1], to[2] - from[2]]);
        const hit = pickVoxel(grid, rays, x, y, grid.occupiedMin, grid.occupiedMax, null);
        assert.equal(hit === null, expected === null, `${name} ${i}`);
        if (!hit || !expected) continue;
        ++hits;
        const [from_, length] = expected.cube;
        assert.ok(
          hit.cell.every((v, c) => v >= from_[c]! && v < from_[c]! + length),
          `${hit.cell} is not in ${from_} + ${length}`,
        );
      }
    }
    assert.ok(hits > 150, `${hits} hits`);
  });
}

test("the pointer gives the voxel's values, and heeds box and plane", () => {
  const grid = packGrid(containerOf("two_tiles")),
    subject = subjectOf(grid);
  const rays = raysOf(
    grid,
    subject,
    { ...START, azimuth: 0, elevation: 0, projection: "orthographic" },
    SIZE,
  )!;
  const at = (
    x: number,
    y: number,
    plane: Vec4 | null,
    box: [Vec3, Vec3] = [grid.occupiedMin, grid.occupiedMax],
  ) => {
    const clip = apply(rays.clipFromGrid, x, y, 2.5, 1);
    return pickVoxel(grid, rays, clip[0] / clip[3], clip[1] / clip[3], ...box, plane);
  };
  const hit = at(256.5, 2.5, null)!;
  assert.deepEqual(hit.cell, [256, 2, 2]);
  assert.deepEqual(hit.color, [0, 2, 2, 255]);
  assert.deepEqual(hit.normal, [1, 0, -1]);
  assert.equal(at(253.5, 2.5, null), null);
  assert.equal(at(256.5, 2.5, [1, 0, 0, -256]), null); // x > 256 is cut
  assert.deepEqual(at(255.5, 2.5, [1, 0, 0, -256])!.cell, [255, 2, 2]);
  assert.equal(
    at(255.5, 2.5, null, [
      [256, 0, 0],
      [300, 20, 10],
    ]),
    null,
  );
  const v = grid.voxelSize,
    o = grid.origin;
  const box: [Vec3, Vec3] = [
    [o[0] + 255 * v[0], o[1], o[2]],
    [o[0] + 257 * v[0], o[1] + 9 * v[1], o[2] + 9 * v[2]],
  ];
  assert.deepEqual(keptCells(grid, { plane: null, box }), [
    [255, 1, 2],
    [257, 4, 3],
  ]);
  assert.equal(keptCells(grid, { plane: null, box: [box[1], box[0]] }), null);
});

test("visible cells hold every cell in the image, and shrink when it is enlarged", () => {
  const grid = packGrid(containerOf("random_9")),
    subject = subjectOf(grid),
    { occupiedMin: low, occupiedMax: high } = grid;
  const whole = raysOf(grid, subject, START, SIZE)!;
  assert.deepEqual(visibleCells(whole.clipFromGrid, low, high), [low, high]);
  for (const camera of CAMERAS) {
    const rays = raysOf(grid, subject, { ...camera, zoom: 6 }, SIZE)!,
      seen = visibleCells(rays.clipFromGrid, low, high);
    for (const [cell] of cubesOf(grid)) {
      const p = pointOf(apply(rays.clipFromGrid, cell[0] + 0.5, cell[1] + 0.5, cell[2] + 0.5, 1));
      if (Math.abs(p[0]) >= 1 || Math.abs(p[1]) >= 1) continue;
      assert.ok(seen && cell.every((v, c) => v >= seen[0][c]! && v < seen[1][c]!), `${cell}`);
    }
    const volume = (a: Vec3, b: Vec3): number => (b[0] - a[0]) * (b[1] - a[1]) * (b[2] - a[2]);
    if (seen) assert.ok(volume(...seen) < 0.7 * volume(low, high), `${seen}`);
  }
  const away = raysOf(grid, subject, { ...START, pan: [5, 0] }, SIZE)!;
  assert.equal(visibleCells(away.clipFromGrid, low, high), null);
});
