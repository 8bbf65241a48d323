// The part of a grid that an image shows.
import type { Vec3 } from "../viewer";
import { apply, inverse, pointOf, type Matrix, type Vec4 } from "./matrix";

// Clip positions p are inside where each of these is not negative.
const SIDES: readonly ((p: Vec4) => number)[] = [
  (p) => p[3] + p[0],
  (p) => p[3] - p[0],
  (p) => p[3] + p[1],
  (p) => p[3] - p[1],
];

/** A polygon without the part on the negative side (Sutherland and Hodgman, 1974). */
function clipped(polygon: readonly Vec4[], side: (p: Vec4) => number): Vec4[] {
  const out: Vec4[] = [];
  for (let i = 0; i < polygon.length; ++i) {
    const a = polygon[i]!,
      b = polygon[(i + 1) % polygon.length]!,
      sa = side(a),
      sb = side(b);
    if (sa >= 0) out.push(a);
    if (sa >= 0 === sb >= 0) continue;
    const t = sa / (sa - sb),
      at = (c: 0 | 1 | 2 | 3): number => a[c] + t * (b[c] - a[c]);
    out.push([at(0), at(1), at(2), at(3)]);
  }
  return out;
}

/** The six faces of a box, as corners by number: bit 0 is x, 1 y, 2 z. */
const FACES = [
  [0, 2, 6, 4],
  [1, 3, 7, 5],
  [0, 1, 5, 4],
  [2, 3, 7, 6],
  [0, 1, 3, 2],
  [4, 5, 7, 6],
];

/** The parts of the four edges of the frustum inside the box, as points. */
function edgesInBox(gridFromClip: Matrix, low: Vec3, high: Vec3): Vec3[] {
  const points: Vec3[] = [];
  for (const [x, y] of [
    [-1, -1],
    [1, -1],
    [-1, 1],
    [1, 1],
  ] as const) {
    const a = pointOf(apply(gridFromClip, x, y, -1, 1)),
      b = pointOf(apply(gridFromClip, x, y, 1, 1));
    let first = 0,
      last = 1;
    for (const c of [0, 1, 2] as const) {
      const step = b[c] - a[c],
        to = (v: number): number => (v - a[c]) / step;
      if (step === 0 && (a[c] < low[c] || a[c] > high[c])) last = -1;
      if (step === 0) continue;
      first = Math.max(first, Math.min(to(low[c]), to(high[c])));
      last = Math.min(last, Math.max(to(low[c]), to(high[c])));
    }
    if (first > last) continue;
    for (const t of [first, last]) {
      points.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])]);
    }
  }
  return points;
}

/** The cells [low, high) of a box that lie in the image, or null. */
export function visibleCells(
  clipFromGrid: Matrix,
  low: Vec3,
  high: Vec3,
): readonly [Vec3, Vec3] | null {
  const gridFromClip = inverse(clipFromGrid);
  if (gridFromClip === null) return null;
  const corners = Array.from({ length: 8 }, (_, i): Vec4 =>
    apply(
      clipFromGrid,
      i & 1 ? high[0] : low[0],
      i & 2 ? high[1] : low[1],
      i & 4 ? high[2] : low[2],
      1,
    ),
  );
  const points = edgesInBox(gridFromClip, low, high);
  for (const face of FACES) {
    const polygon = SIDES.reduce(
      clipped,
      face.map((corner) => corners[corner]!),
    );
    for (const p of polygon) points.push(pointOf(apply(gridFromClip, ...p)));
  }
  if (points.length === 0) return null;
  // Points on the box come back with errors of rounding.
  const least = (c: 0 | 1 | 2): number =>
    Math.max(low[c], Math.floor(Math.min(...points.map((p) => p[c])) + 1e-6));
  const most = (c: 0 | 1 | 2): number =>
    Math.min(high[c], Math.ceil(Math.max(...points.map((p) => p[c])) - 1e-6));
  const from: Vec3 = [least(0), least(1), least(2)],
    to: Vec3 = [most(0), most(1), most(2)];
  return from.every((v, c) => v < to[c]!) ? [from, to] : null;
}
