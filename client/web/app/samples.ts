// Models to try, made here, so that the page needs no other files. Each is a bundle as if it was
// dropped, and a picture of it in voxels.
import type { NamedFile } from "./files";
import type { Cells } from "./icon";
import { T } from "./texts";

export interface Sample {
  readonly name: string;
  readonly hint: T;
  readonly icon: Cells; // of 12^3 cells
  make(): Promise<NamedFile[]>;
}

type Vec3 = [number, number, number];
type Rgb = readonly [number, number, number];

/** Triangles with a colour for each vertex. */
class Surface {
  readonly points: Vec3[] = [];
  readonly colors: Rgb[] = [];
  readonly triangles: Vec3[] = [];

  /** A grid of points (u, v), closed around u, and around v or with poles, joined by triangles. */
  wrap(
    columns: number,
    rows: number,
    closesRows: boolean,
    at: (u: number, v: number) => [Vec3, Rgb],
  ): void {
    const first = this.points.length;
    const count = closesRows ? rows : rows + 1;
    for (let j = 0; j < count; ++j) {
      for (let i = 0; i < columns; ++i) {
        const [point, color] = at(i / columns, j / rows);
        this.points.push(point);
        this.colors.push(color);
      }
    }
    const index = (i: number, j: number) => first + (j % count) * columns + (i % columns);
    for (let j = 0; j < rows; ++j) {
      for (let i = 0; i < columns; ++i) {
        const [a, b, c, d] = [index(i, j), index(i + 1, j), index(i, j + 1), index(i + 1, j + 1)];
        this.triangles.push([a, b, c], [b, d, c]);
      }
    }
  }

  ply(): Blob {
    const head =
      `ply\nformat binary_little_endian 1.0\nelement vertex ${this.points.length}\n` +
      "property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n" +
      `element face ${this.triangles.length}\nproperty list uchar int vertex_indices\nend_header\n`;
    const data = new DataView(
      new ArrayBuffer(15 * this.points.length + 13 * this.triangles.length),
    );
    let offset = 0;
    this.points.forEach((point, i) => {
      point.forEach((value, k) => data.setFloat32(offset + 4 * k, value, true));
      (this.colors[i] as Rgb).forEach((value, k) => data.setUint8(offset + 12 + k, value));
      offset += 15;
    });
    for (const triangle of this.triangles) {
      data.setUint8(offset, 3);
      triangle.forEach((value, k) => data.setInt32(offset + 1 + 4 * k, value, true));
      offset += 13;
    }
    return new Blob([head, data.buffer as ArrayBuffer]);
  }
}

const WHITE: Rgb = [240, 238, 230],
  RED: Rgb = [214, 58, 44],
  DARK: Rgb = [52, 58, 70],
  BLUE: Rgb = [72, 148, 208];
const TAU = 2 * Math.PI;

// Radius of the rocket's body at its height, 0..1.
function rocketRadius(v: number): number {
  return (
    0.16 *
    Math.sqrt(Math.max(0, Math.min(1, 3.2 * (1 - v)))) *
    (0.72 + 0.28 * Math.sin(Math.PI * Math.min(1, 0.18 + v)))
  );
}

function rocketColor(u: number, v: number): Rgb {
  if (v > 0.76) return RED;
  const dx = (u - 0.25) * 1.05,
    dy = v - 0.6; // the window
  if (dx * dx + dy * dy < 0.0042) return BLUE;
  if (dx * dx + dy * dy < 0.0075) return DARK;
  return v < 0.06 || (v > 0.3 && v < 0.34) ? DARK : WHITE;
}

async function rocket(): Promise<NamedFile[]> {
  const surface = new Surface();
  surface.wrap(96, 120, false, (u, row) => {
    const v = Math.min(1, Math.max(0, (row - 0.02) / 0.96));
    const r = row === 0 || row === 1 ? 0 : rocketRadius(v);
    return [[r * Math.cos(TAU * u), v, r * Math.sin(TAU * u)], rocketColor(u, v)];
  });
  for (let fin = 0; fin < 4; ++fin) {
    const angle = TAU * (fin / 4 + 0.125);
    surface.wrap(24, 12, false, (u, v) => {
      // a flat, closed blade
      const along = Math.cos(TAU * u),
        across = Math.sin(TAU * u);
      const s = Math.sin(Math.PI * v);
      const r = 0.16 + 0.13 * s * along,
        y = 0.1 - 0.2 * (r - 0.16) + 0.2 * (0.5 - v) - 0.03,
        w = 0.018 * s * across;
      return [
        [r * Math.cos(angle) - w * Math.sin(angle), y, r * Math.sin(angle) + w * Math.cos(angle)],
        RED,
      ];
    });
  }
  return [{ name: "rocket.ply", blob: surface.ply() }];
}

async function knot(): Promise<NamedFile[]> {
  const surface = new Surface();
  const curve = (a: number): Vec3 => {
    const r = 1 + 0.42 * Math.cos(3 * a);
    return [r * Math.cos(2 * a), 0.5 * Math.sin(3 * a), r * Math.sin(2 * a)];
  };
  surface.wrap(24, 480, true, (u, v) => {
    const p = curve(TAU * v),
      q = curve(TAU * v + 0.001);
    const t = unit([q[0] - p[0], q[1] - p[1], q[2] - p[2]]);
    const side = unit(cross(t, [0, 1, 0])),
      up = cross(side, t);
    const c = 0.17 * Math.cos(TAU * u),
      s = 0.17 * Math.sin(TAU * u);
    const hue = (phase: number) => Math.round(140 + 100 * Math.sin(TAU * (v + phase)));
    return [
      [
        p[0] + c * side[0] + s * up[0],
        p[1] + c * side[1] + s * up[1],
        p[2] + c * side[2] + s * up[2],
      ],
      [hue(0), hue(0.33), hue(0.66)],
    ];
  });
  return [{ name: "knot.ply", blob: surface.ply() }];
}

function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(a: Vec3): Vec3 {
  const length = Math.hypot(...a);
  return [a[0] / length, a[1] / length, a[2] / length];
}

// Height of the planet's land at a direction; below 0 is sea.
function land(x: number, y: number, z: number): number {
  return (
    Math.sin(3.1 * x + 1.3) * Math.sin(2.7 * z + 0.4) +
    0.6 * Math.sin(5.3 * y + 2 * x) +
    0.35 * Math.sin(9 * z - 4 * y) -
    0.25
  );
}

function planetColor(x: number, y: number, z: number): Rgb {
  if (Math.abs(y) > 0.86 + 0.04 * Math.sin(9 * Math.atan2(z, x))) return [244, 248, 252];
  const height = land(x, y, z);
  if (height < 0) return height > -0.12 ? [70, 160, 200] : [34, 98, 168];
  return height < 0.08 ? [226, 205, 140] : height < 0.7 ? [92, 158, 70] : [134, 112, 84];
}

// A ball as OBJ, with its colours in a texture: three files.
async function planet(): Promise<NamedFile[]> {
  const columns = 96,
    rows = 48;
  const lines = ["mtllib planet.mtl", "usemtl ground"];
  for (let j = 0; j <= rows; ++j) {
    for (let i = 0; i <= columns; ++i) {
      const a = (TAU * i) / columns,
        b = (Math.PI * j) / rows;
      const wraps = i === columns ? 0 : a; // the seam has equal points
      lines.push(
        `v ${(Math.sin(b) * Math.cos(wraps)).toFixed(5)} ${Math.cos(b).toFixed(5)} ${(Math.sin(b) * Math.sin(wraps)).toFixed(5)}`,
        `vt ${(i / columns).toFixed(5)} ${(1 - j / rows).toFixed(5)}`,
      );
    }
  }
  const index = (i: number, j: number) => j * (columns + 1) + i + 1;
  for (let j = 0; j < rows; ++j) {
    for (let i = 0; i < columns; ++i) {
      const [a, b, c, d] = [index(i, j), index(i + 1, j), index(i, j + 1), index(i + 1, j + 1)];
      if (j > 0) lines.push(`f ${a}/${a} ${b}/${b} ${c}/${c}`);
      if (j < rows - 1) lines.push(`f ${b}/${b} ${d}/${d} ${c}/${c}`);
    }
  }
  const canvas = document.createElement("canvas");
  canvas.width = 512;
  canvas.height = 256;
  const context = canvas.getContext("2d") as CanvasRenderingContext2D;
  const image = context.createImageData(canvas.width, canvas.height);
  for (let p = 0; p < canvas.width * canvas.height; ++p) {
    const a = (TAU * ((p % 512) + 0.5)) / 512,
      b = (Math.PI * (Math.floor(p / 512) + 0.5)) / 256;
    image.data.set(
      [...planetColor(Math.sin(b) * Math.cos(a), Math.cos(b), Math.sin(b) * Math.sin(a)), 255],
      4 * p,
    );
  }
  context.putImageData(image, 0, 0);
  const png = await new Promise<Blob>((resolve, reject) =>
    canvas.toBlob(blob => (blob ? resolve(blob) : reject(new Error("no PNG"))), "image/png"),
  );
  return [
    { name: "planet.obj", blob: new Blob([lines.join("\n") + "\n"]) },
    { name: "planet.mtl", blob: new Blob(["newmtl ground\nKd 1 1 1\nmap_Kd planet.png\n"]) },
    { name: "planet.png", blob: png },
  ];
}

const WORM_PARTS = 12,
  WORM_KEYS = 25,
  WORM_SECONDS = 2;

function wormColor(part: number): Rgb {
  return part === WORM_PARTS - 1 ? [232, 92, 64] : part % 2 ? [120, 186, 72] : [72, 138, 62];
}

// A row of balls that creep: a GLB with a node and an animation channel for each.
async function worm(): Promise<NamedFile[]> {
  const ball = new Surface();
  ball.wrap(24, 14, false, (u, v) => {
    const s = Math.sin(Math.PI * v);
    return [[s * Math.cos(TAU * u), Math.cos(Math.PI * v), s * Math.sin(TAU * u)], WHITE];
  });
  const positions = new Float32Array(ball.points.flat());
  const indices = new Uint16Array(ball.triangles.flat());
  const times = new Float32Array(WORM_KEYS).map((_, k) => (WORM_SECONDS * k) / (WORM_KEYS - 1));
  const paths = Array.from(
    { length: WORM_PARTS },
    (_, part) =>
      new Float32Array(
        Array.from({ length: WORM_KEYS }, (__, k) => {
          const phase = TAU * (k / (WORM_KEYS - 1) + (part / WORM_PARTS) * 1.5);
          return [
            1.15 * part + 0.35 * Math.sin(phase),
            1 + 1.3 * Math.max(0, Math.sin(phase)),
            0.5 * Math.cos(phase),
          ];
        }).flat(),
      ),
  );
  const pieces: ArrayBufferView[] = [positions, indices, times, ...paths];
  let offset = 0;
  const bufferViews = pieces.map(piece => {
    const view = { buffer: 0, byteOffset: offset, byteLength: piece.byteLength };
    offset += Math.ceil(piece.byteLength / 4) * 4;
    return view;
  });
  const bytes = new Uint8Array(offset);
  pieces.forEach((piece, i) =>
    bytes.set(
      new Uint8Array(piece.buffer as ArrayBuffer, piece.byteOffset, piece.byteLength),
      (bufferViews[i] as { byteOffset: number }).byteOffset,
    ),
  );
  const FLOAT = 5126,
    SHORT = 5123;
  const json = {
    asset: { version: "2.0", generator: "voxeld" },
    scene: 0,
    scenes: [{ nodes: paths.map((_, part) => part) }],
    nodes: paths.map((_, part) => ({
      name: `part ${part + 1}`,
      mesh: part,
      translation: [1.15 * part, 1, 0],
    })),
    materials: paths.map((_, part) => ({
      name: `part ${part + 1}`,
      pbrMetallicRoughness: {
        baseColorFactor: [...wormColor(part).map(c => (c / 255) ** 2.2), 1],
        metallicFactor: 0,
      },
    })),
    meshes: paths.map((_, part) => ({
      primitives: [{ attributes: { POSITION: 0 }, indices: 1, material: part }],
    })),
    animations: [
      {
        name: "creep",
        samplers: paths.map((_, part) => ({ input: 2, output: 3 + part, interpolation: "LINEAR" })),
        channels: paths.map((_, part) => ({
          sampler: part,
          target: { node: part, path: "translation" },
        })),
      },
    ],
    accessors: [
      {
        bufferView: 0,
        componentType: FLOAT,
        count: ball.points.length,
        type: "VEC3",
        min: [-1, -1, -1],
        max: [1, 1, 1],
      },
      { bufferView: 1, componentType: SHORT, count: indices.length, type: "SCALAR" },
      {
        bufferView: 2,
        componentType: FLOAT,
        count: WORM_KEYS,
        type: "SCALAR",
        min: [0],
        max: [WORM_SECONDS],
      },
      ...paths.map((_, part) => ({
        bufferView: 3 + part,
        componentType: FLOAT,
        count: WORM_KEYS,
        type: "VEC3",
      })),
    ],
    bufferViews,
    buffers: [{ byteLength: bytes.length }],
  };
  return [{ name: "worm.glb", blob: glb(json, bytes) }];
}

function glb(json: unknown, bytes: Uint8Array<ArrayBuffer>): Blob {
  let text = new TextEncoder().encode(JSON.stringify(json));
  const padded = new Uint8Array(Math.ceil(text.length / 4) * 4).fill(0x20);
  padded.set(text);
  text = padded;
  const words = (...values: number[]) => new Uint32Array(values);
  return new Blob([
    words(0x46546c67, 2, 28 + text.length + bytes.length, text.length, 0x4e4f534a),
    text,
    words(bytes.length, 0x004e4942),
    bytes,
  ]);
}

// --- pictures, in 12^3 cells

const at = (x: number) => x - 5.5;

const rocketIcon: Cells = (x, y, z) => {
  const v = (y + 0.5) / 12,
    r = Math.hypot(at(x), at(z));
  const body = 13.5 * rocketRadius(v);
  if (r <= body) return v > 0.74 ? RED : x > 6 && z > 6 && y > 5 && y < 8 ? BLUE : WHITE;
  return y < 3 && r < 5.2 - y && (Math.abs(at(x)) < 1 || Math.abs(at(z)) < 1) ? RED : null;
};

const planetIcon: Cells = (x, y, z) => {
  const p: Vec3 = [at(x), at(y), at(z)];
  return Math.hypot(...p) < 5.9 ? planetColor(...unit(p)) : null;
};

const knotIcon: Cells = (x, y, z) => {
  for (let a = 0; a < TAU; a += 0.06) {
    const r = 3.2 + 1.5 * Math.cos(3 * a);
    if (
      Math.hypot(
        at(x) - r * Math.cos(2 * a),
        at(y) - 2.6 * Math.sin(3 * a),
        at(z) - r * Math.sin(2 * a),
      ) < 1.15
    ) {
      const hue = (phase: number) => Math.round(140 + 100 * Math.sin(a + TAU * phase));
      return [hue(0), hue(0.33), hue(0.66)];
    }
  }
  return null;
};

const wormIcon: Cells = (x, y, z) => {
  for (let part = 0; part < 6; ++part) {
    const px = 1.4 + 1.9 * part,
      py = 2 + 3.4 * Math.max(0, Math.sin(part * 1.15 + 0.4));
    if (Math.hypot(x - px, y - py, at(z)) < 1.9)
      return wormColor(part === 5 ? WORM_PARTS - 1 : part);
  }
  return null;
};

export const samples: readonly Sample[] = [
  { name: "sampleRocket", hint: T.sampleRocketHint, icon: rocketIcon, make: rocket },
  { name: "samplePlanet", hint: T.samplePlanetHint, icon: planetIcon, make: planet },
  { name: "sampleKnot", hint: T.sampleKnotHint, icon: knotIcon, make: knot },
  { name: "sampleWorm", hint: T.sampleWormHint, icon: wormIcon, make: worm },
];
