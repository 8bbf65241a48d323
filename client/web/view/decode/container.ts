// Header and directory of the native container (proto/README.md), checked before anything is
// decoded. Texts are those of the C++ decoder.
import type { Channel, Vec3 } from "../viewer";
import { CHANNELS } from "./channels";
import { fail } from "./decode_error";
import { mortonOf } from "./morton";

const HEADER_BYTES = 128;
const VERSION = 3;
const SIDE_MAX = 16384;
const TILE_LOG2 = 8;
const CODECS_BYTE = 104;
const ENTRY_STREAMS_BYTE = 36;
const TILE_VOXELS_MAX = 1n << 24n;
const META_BYTES_MAX = 1 << 24;

export interface TileEntry {
  readonly coord: Vec3; // in tiles
  readonly brickCount: number;
  readonly voxelCount: number;
  readonly octree: Uint8Array;
  readonly streams: readonly Uint8Array[]; // of the container's channels; empty without bricks
  readonly offset: number; // of the octree's stream in the container
}

export interface Container {
  readonly dims: Vec3; // cells
  readonly origin: Vec3;
  readonly voxelSize: Vec3;
  readonly channels: readonly Channel[];
  readonly voxelCount: number;
  readonly tiles: readonly TileEntry[];
}

export function brokenGrid(byte: number, detail: string, expected = "", got = ""): never {
  fail(`grid container, byte ${byte}: ${detail}`, expected, got);
}

function numberText(value: number): string {
  return Number.isFinite(value) ? value.toFixed(6) : value > 0 ? "inf" : value < 0 ? "-inf" : "nan";
}

function tripleOf(get: (axis: number) => number): Vec3 {
  return [get(0), get(1), get(2)];
}

class Reader {
  readonly #view: DataView;
  #channelBits = 0;
  #entryBytes = 0;

  constructor(private readonly bytes: Uint8Array) {
    this.#view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  read(): Container {
    this.#checkMagic();
    const dims = tripleOf((c) => this.#view.getInt32(16 + 4 * c, true));
    const origin = tripleOf((c) => this.#view.getFloat64(32 + 8 * c, true));
    const voxelSize = tripleOf((c) => this.#view.getFloat64(56 + 8 * c, true));
    this.#checkPlacement(dims, origin, voxelSize);
    this.#checkRest();
    const tiles = this.#directory(dims);
    const channels = CHANNELS.filter((_, i) => this.#has(i)).map((channel) => channel.name);
    const voxelCount = Number(this.#view.getBigUint64(88, true));
    return { dims, origin, voxelSize, channels, voxelCount, tiles };
  }

  #u32(at: number): number {
    return this.#view.getUint32(at, true);
  }
  #has(channel: number): boolean {
    return ((this.#channelBits >> channel) & 1) !== 0;
  }

  #checkMagic(): void {
    const size = this.bytes.length;
    if (size < HEADER_BYTES) {
      brokenGrid(size, "the header is cut off", `${HEADER_BYTES} bytes`, String(size));
    }
    const magic = String.fromCharCode(...this.bytes.subarray(0, 8));
    if (magic !== "VOXGRID\0") {
      brokenGrid(0, "not a grid container", "the magic VOXGRID", "other bytes");
    }
    if (this.#u32(8) !== VERSION) brokenGrid(8, "version", String(VERSION), String(this.#u32(8)));
    this.#channelBits = this.#u32(12);
    if (this.#channelBits >>> CHANNELS.length !== 0) brokenGrid(12, "unknown channels");
    const count = CHANNELS.filter((_, i) => this.#has(i)).length;
    this.#entryBytes = (36 + 4 * count + 7) & ~7;
  }

  #checkPlacement(dims: Vec3, origin: Vec3, voxelSize: Vec3): void {
    for (let c = 0; c < 3; ++c) {
      if (dims[c]! < 1 || dims[c]! > SIDE_MAX) {
        brokenGrid(16, "dims", `1 to ${SIDE_MAX}`, String(dims[c]));
      }
      if (!Number.isFinite(origin[c])) brokenGrid(16, "origin is not finite");
      if (!Number.isFinite(voxelSize[c]) || voxelSize[c]! <= 0) {
        brokenGrid(16, "voxel size", "a finite number above 0", numberText(voxelSize[c]!));
      }
    }
    if (this.#u32(28) !== TILE_LOG2) brokenGrid(28, "tile side", "8", "another");
  }

  #checkRest(): void {
    const total = this.#view.getBigUint64(96, true);
    if (total !== BigInt(this.bytes.length)) {
      brokenGrid(96, "length", `${total} bytes`, String(this.bytes.length));
    }
    let hasSmall = false;
    for (let i = 0; i <= CHANNELS.length; ++i) {
      const exists = i === 0 || this.#has(i - 1),
        codec = this.bytes[CODECS_BYTE + i]!;
      if (codec > (exists ? 1 : 0)) {
        brokenGrid(CODECS_BYTE + i, "codec of a stream", exists ? "0 or 1" : "0", String(codec));
      }
      hasSmall ||= codec === 1;
    }
    for (let i = CODECS_BYTE + 1 + CHANNELS.length; i < HEADER_BYTES; ++i) {
      if (this.bytes[i] !== 0) brokenGrid(i, "reserved byte", "0", String(this.bytes[i]));
    }
    if (hasSmall)
      brokenGrid(CODECS_BYTE, "codec of a stream", "fast, which the page reads", "small");
  }

  #directory(dims: Vec3): TileEntry[] {
    const tileCount = this.#u32(80),
      metaBytes = this.#u32(84),
      size = this.bytes.length;
    const first = HEADER_BYTES + Math.ceil(metaBytes / 8) * 8;
    if (
      metaBytes > META_BYTES_MAX ||
      first > size ||
      Math.floor((size - first) / this.#entryBytes) < tileCount
    ) {
      brokenGrid(80, "meta or directory is cut off");
    }
    for (let i = HEADER_BYTES + metaBytes; i < first; ++i) {
      if (this.bytes[i] !== 0) brokenGrid(i, "padding", "0", String(this.bytes[i]));
    }
    const tiles: TileEntry[] = [];
    let next = first + tileCount * this.#entryBytes,
      voxels = 0n,
      order = -1;
    for (let i = 0; i < tileCount; ++i) {
      const at = first + i * this.#entryBytes;
      order = this.#checkCoord(at, dims, order);
      const tile = this.#entry(at, next);
      voxels += BigInt(tile.voxelCount);
      next += tile.octree.length + tile.streams.reduce((sum, stream) => sum + stream.length, 0);
      tiles.push(tile);
    }
    if (next !== size) brokenGrid(next, "bytes after the last tile");
    const stated = this.#view.getBigUint64(88, true);
    if (voxels !== stated) brokenGrid(88, "voxel count", String(voxels), String(stated));
    return tiles;
  }

  #coordAt(at: number): Vec3 {
    return tripleOf((c) => this.#view.getInt32(at + 4 * c, true));
  }

  /** The coord's place in Morton order, which must be above that of the tile before. */
  #checkCoord(at: number, dims: Vec3, before: number): number {
    const coord = this.#coordAt(at);
    for (let c = 0; c < 3; ++c) {
      if (coord[c]! < 0 || coord[c]! >= Math.ceil(dims[c]! / 256)) {
        brokenGrid(at, "tile coord is outside the grid");
      }
    }
    const order = mortonOf(coord[0], coord[1], coord[2]);
    if (before >= order) brokenGrid(at, "tiles are not in ascending Morton order");
    return order;
  }

  #entry(at: number, offset: number): TileEntry {
    const brickCount = this.#u32(at + 12),
      voxelCount = this.#view.getBigUint64(at + 16, true);
    if (voxelCount === 0n || voxelCount > TILE_VOXELS_MAX) {
      brokenGrid(at + 16, "voxel count", `1 to ${TILE_VOXELS_MAX}`, String(voxelCount));
    }
    const stated = this.#view.getBigUint64(at + 24, true);
    if (stated !== BigInt(offset)) {
      brokenGrid(at + 24, "tile offset", String(offset), String(stated));
    }
    const lengths = [this.#u32(at + 32)];
    let next = at + ENTRY_STREAMS_BYTE,
      match = lengths[0] !== 0;
    for (let i = 0; i < CHANNELS.length; ++i) {
      if (!this.#has(i)) continue;
      const length = this.#u32(next);
      lengths.push(length);
      match &&= (length !== 0) === (brickCount !== 0);
      next += 4;
    }
    if (!match) brokenGrid(at + 32, "streams do not match the channels");
    if (next < at + this.#entryBytes && this.#u32(next) !== 0) {
      brokenGrid(next, "reserved bytes", "0", "others");
    }
    const end = lengths.reduce((sum, length) => sum + length, offset);
    if (end > this.bytes.length) brokenGrid(at + 24, "tile data lie beyond the end");
    let from = offset;
    const [octree, ...streams] = lengths.map((length) =>
      this.bytes.subarray(from, (from += length)),
    );
    return {
      coord: this.#coordAt(at),
      brickCount,
      voxelCount: Number(voxelCount),
      octree: octree!,
      streams,
      offset,
    };
  }
}

/** Throws a DecodeError. The tiles' streams are views of the bytes. */
export function openContainer(bytes: Uint8Array): Container {
  return new Reader(bytes).read();
}
