// The orbit camera of /v1/render (server/render/camera.cpp): it stands where the sphere around the
// occupied box fills 35 degrees, and the image is magnified and shifted so that the voxels take 92%
// of its width or height.
import type { PackedGrid } from "../pack/packed_grid";
import type { Camera, Vec3 } from "../viewer";
import {
  apply,
  dot,
  length,
  minus,
  scaled,
  scaling,
  times,
  translation,
  type Matrix,
} from "./matrix";

const FIELD_OF_VIEW_DEG = 35;
const FRAME_SHARE = 0.92;
const DEPTH_MARGIN = 1.01;

/** The thing that an image frames, in world units. */
export interface Subject {
  readonly low: Vec3; // a box around it
  readonly high: Vec3;
  readonly points: Float64Array; // x, y, z of points whose convex hull holds it
}

export interface Size {
  readonly width: number; // pixels
  readonly height: number;
}

export function worldFromGrid(grid: Pick<PackedGrid, "origin" | "voxelSize">, p: Vec3): Vec3 {
  const at = (c: 0 | 1 | 2): number => grid.origin[c] + p[c] * grid.voxelSize[c];
  return [at(0), at(1), at(2)];
}

export function subjectOf(grid: PackedGrid): Subject {
  const { dims, hull, occupiedMin, occupiedMax } = grid;
  const cells = hull.length > 0 ? Array.from(hull) : [];
  for (let i = 0; i < 8 && hull.length === 0; ++i) {
    cells.push(i & 1 ? dims[0] : 0, i & 2 ? dims[1] : 0, i & 4 ? dims[2] : 0);
  }
  const points = new Float64Array(cells.length);
  for (let i = 0; i < cells.length; i += 3) {
    points.set(worldFromGrid(grid, [cells[i]!, cells[i + 1]!, cells[i + 2]!]), i);
  }
  return { low: worldFromGrid(grid, occupiedMin), high: worldFromGrid(grid, occupiedMax), points };
}

/** At the poles "up" is the limit. */
function viewFromWorld(azimuth: number, elevation: number, eye: Vec3): Matrix {
  const sa = Math.sin(azimuth),
    ca = Math.cos(azimuth),
    se = Math.sin(elevation),
    ce = Math.cos(elevation);
  const right: Vec3 = [ca, 0, -sa],
    up: Vec3 = [-sa * se, ce, -ca * se],
    back: Vec3 = [sa * ce, se, ca * ce];
  const column = (c: 0 | 1 | 2): number[] => [right[c], up[c], back[c], 0];
  return [
    ...column(0),
    ...column(1),
    ...column(2),
    -dot(right, eye),
    -dot(up, eye),
    -dot(back, eye),
    1,
  ];
}

function radians(degrees: number): number {
  return (degrees * Math.PI) / 180;
}

function clipFromView(
  isPerspective: boolean,
  radius: number,
  distance: number,
  size: Size,
): Matrix {
  const near = distance - DEPTH_MARGIN * radius,
    far = distance + DEPTH_MARGIN * radius;
  const shorter = Math.min(size.width, size.height);
  const x = shorter / size.width,
    y = shorter / size.height;
  if (!isPerspective) {
    return [
      x / radius,
      0,
      0,
      0,
      0,
      y / radius,
      0,
      0,
      0,
      0,
      2 / (near - far),
      0,
      0,
      0,
      (far + near) / (near - far),
      1,
    ];
  }
  const focal = 1 / Math.tan(radians(0.5 * FIELD_OF_VIEW_DEG));
  return [
    focal * x,
    0,
    0,
    0,
    0,
    focal * y,
    0,
    0,
    0,
    0,
    (far + near) / (near - far),
    -1,
    0,
    0,
    (2 * far * near) / (near - far),
    0,
  ];
}

/** Puts the image of the points into the middle: clip positions times scale, plus shift. */
interface Fit {
  readonly scale: number;
  readonly shift: readonly [number, number];
}

function fitOf(points: Float64Array, clipFromWorld: Matrix): Fit {
  if (points.length === 0) return { scale: 1, shift: [0, 0] };
  let xLow = Infinity,
    yLow = Infinity,
    xHigh = -Infinity,
    yHigh = -Infinity;
  for (let i = 0; i < points.length; i += 3) {
    const [cx, cy, , cw] = apply(clipFromWorld, points[i]!, points[i + 1]!, points[i + 2]!, 1);
    const x = cx / cw,
      y = cy / cw;
    xLow = Math.min(xLow, x);
    xHigh = Math.max(xHigh, x);
    yLow = Math.min(yLow, y);
    yHigh = Math.max(yHigh, y);
  }
  const scale = (2 * FRAME_SHARE) / Math.max(xHigh - xLow, yHigh - yLow, 1e-300);
  return { scale, shift: [(-scale * (xLow + xHigh)) / 2, (-scale * (yLow + yHigh)) / 2] };
}

/** The camera before it is fitted, with its fit. */
function framed(camera: Camera, subject: Subject, size: Size): { base: Matrix; fit: Fit } {
  const center = scaled(
    [
      subject.low[0] + subject.high[0],
      subject.low[1] + subject.high[1],
      subject.low[2] + subject.high[2],
    ],
    0.5,
  );
  const radius = Math.max(0.5 * length(minus(subject.high, subject.low)), 1e-300);
  const azimuth = radians(camera.azimuth),
    elevation = radians(camera.elevation);
  const isPerspective = camera.projection === "perspective";
  // A sphere fills the angle if the sides of the frustum are tangent to it.
  const distance = isPerspective ? radius / Math.sin(radians(0.5 * FIELD_OF_VIEW_DEG)) : 2 * radius;
  const eye: Vec3 = [
    center[0] + distance * Math.sin(azimuth) * Math.cos(elevation),
    center[1] + distance * Math.sin(elevation),
    center[2] + distance * Math.cos(azimuth) * Math.cos(elevation),
  ];
  const base = times(
    clipFromView(isPerspective, radius, distance, size),
    viewFromWorld(azimuth, elevation, eye),
  );
  return { base, fit: fitOf(subject.points, base) };
}

/** Maps world space to the clip space of OpenGL. */
export function clipFromWorld(camera: Camera, subject: Subject, size: Size): Matrix {
  const { base, fit } = framed(camera, subject, size);
  const { zoom, pan } = camera;
  const x = zoom * fit.shift[0] + (2 * pan[0] * size.height) / size.width;
  const y = zoom * fit.shift[1] + 2 * pan[1];
  // The shift is times w: the same at every depth.
  return times(times(translation(x, y, 0), scaling(zoom * fit.scale, zoom * fit.scale, 1)), base);
}

/**
 * The camera at other angles, so that the subject turns around the middle of its box and neither
 * changes its size nor moves. zoom and pan make up for the fit, which differs from angle to angle.
 */
export function orbited(
  camera: Camera,
  subject: Subject,
  size: Size,
  azimuth: number,
  elevation: number,
): Camera {
  const turned: Camera = { ...camera, azimuth, elevation };
  const before = framed(camera, subject, size).fit,
    after = framed(turned, subject, size).fit;
  const zoom = (camera.zoom * before.scale) / after.scale;
  // The middle of the box is in the middle of an image that is not fitted.
  const moved = (c: 0 | 1): number => camera.zoom * before.shift[c] - zoom * after.shift[c];
  const pan: [number, number] = [
    camera.pan[0] + (moved(0) * size.width) / (2 * size.height),
    camera.pan[1] + moved(1) / 2,
  ];
  return { ...turned, zoom, pan };
}

/** The camera at another zoom, so that the point at (x, y) of the image stays: fractions of the
 * height from the middle, y up. */
export function zoomed(camera: Camera, zoom: number, x: number, y: number): Camera {
  const by = zoom / camera.zoom;
  return { ...camera, zoom, pan: [x + (camera.pan[0] - x) * by, y + (camera.pan[1] - y) * by] };
}
