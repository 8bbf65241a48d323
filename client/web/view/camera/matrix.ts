// Matrices of 4 x 4 doubles, column by column as OpenGL has them.
import type { Vec3 } from "../viewer";

export type Matrix = readonly number[]; // 16
export type Vec4 = readonly [number, number, number, number];

export function times(a: Matrix, b: Matrix): Matrix {
  const out: number[] = [];
  for (let column = 0; column < 4; ++column) {
    for (let row = 0; row < 4; ++row) {
      let sum = 0;
      for (let k = 0; k < 4; ++k) sum += a[4 * k + row]! * b[4 * column + k]!;
      out.push(sum);
    }
  }
  return out;
}

export function apply(m: Matrix, x: number, y: number, z: number, w: number): Vec4 {
  const at = (row: number): number =>
    m[row]! * x + m[4 + row]! * y + m[8 + row]! * z + m[12 + row]! * w;
  return [at(0), at(1), at(2), at(3)];
}

export function scaling(x: number, y: number, z: number): Matrix {
  return [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
}

export function translation(x: number, y: number, z: number): Matrix {
  return [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
}

/** The inverse by Gauss and Jordan with pivots; null if there is none. */
export function inverse(m: Matrix): Matrix | null {
  // Rows of the matrix beside those of the identity.
  const rows = [0, 1, 2, 3].map((r) =>
    [0, 1, 2, 3].map((c) => m[4 * c + r]!).concat([0, 1, 2, 3].map((c) => (c === r ? 1 : 0))),
  );
  for (let column = 0; column < 4; ++column) {
    let pivot = column;
    for (let r = column + 1; r < 4; ++r) {
      if (Math.abs(rows[r]![column]!) > Math.abs(rows[pivot]![column]!)) pivot = r;
    }
    const row = rows[pivot]!,
      by = row[column]!;
    if (!(Math.abs(by) > 0) || !Number.isFinite(by)) return null;
    rows[pivot] = rows[column]!;
    rows[column] = row.map((value) => value / by);
    for (let r = 0; r < 4; ++r) {
      const factor = rows[r]![column]!;
      if (r !== column) rows[r] = rows[r]!.map((value, c) => value - factor * rows[column]![c]!);
    }
  }
  return [0, 1, 2, 3].flatMap((c) => [0, 1, 2, 3].map((r) => rows[r]![4 + c]!));
}

export function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
export function minus(a: Vec3, b: Vec3): Vec3 {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}
export function scaled(a: Vec3, by: number): Vec3 {
  return [a[0] * by, a[1] * by, a[2] * by];
}
export function length(a: Vec3): number {
  return Math.hypot(a[0], a[1], a[2]);
}
export function normalized(a: Vec3): Vec3 {
  return scaled(a, 1 / length(a));
}
/** The point of homogeneous coordinates. */
export function pointOf(p: Vec4): Vec3 {
  return [p[0] / p[3], p[1] / p[3], p[2] / p[3]];
}
