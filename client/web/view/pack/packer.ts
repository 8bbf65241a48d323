// Packs a container into the tables of the ray march, word by word as server/render/packed_grid.cpp
// does (tests/web/view compares them).
import { channelIn, CHANNELS, ownChannel } from "../decode/channels";
import { brokenGrid, openContainer, type Container, type TileEntry } from "../decode/container";
import { fail } from "../decode/decode_error";
import { bitCount, compact, mortonOf } from "../decode/morton";
import {
  checkFullNodes,
  checkMasks,
  Octree,
  OCTREE_BYTES_MAX,
  type FullNode,
} from "../decode/octree";
import { decompressStream } from "../decode/zstd_stream";
import type { Channel, Vec3 } from "../viewer";
import { Rows } from "./hull";
import { markEmptyCubes } from "./empty_cubes";
import { meanOfAll, setColorMeans, setNormalMeans } from "./means";
import { paintOf } from "./paint";
import {
  BLOCK_WORDS,
  BRICK_FIRST,
  BRICK_NODES,
  BRICK_WORDS,
  CHILD,
  FULL,
  TABLE_WORDS_MAX,
  tableOf,
  TILE_ENTRIES,
  type Attributes,
  type PackedGrid,
  type Words,
} from "./packed_grid";

const TILE_LEVELS = 5; // from a brick up to a tile
const SLACK = 1e-6; // of a brick's side, within which cells of two grids count as aligned

interface OpenTile {
  readonly entry: TileEntry;
  readonly attributeVoxels: number;
}

function bytesOf(words: Words): Uint8Array<ArrayBuffer> {
  return new Uint8Array(words.buffer);
}

/** The first cell of a tile. */
function cornerOf(coord: Vec3): Vec3 {
  return [256 * coord[0], 256 * coord[1], 256 * coord[2]];
}

function needWords(what: string, words: number): void {
  if (words > TABLE_WORDS_MAX) {
    fail(
      `the grid has too many ${what} to draw`,
      `at most ${TABLE_WORDS_MAX}`,
      String(words),
    );
  }
}

export class Packer {
  readonly #container: Container;
  readonly #tileDims: Vec3;
  readonly #bricks: Words;
  readonly #masks: Uint8Array<ArrayBuffer>; // the same bytes
  readonly #rows: Rows;
  readonly #tiles: OpenTile[] = [];
  readonly #low = [Infinity, Infinity, Infinity];
  readonly #high = [-Infinity, -Infinity, -Infinity];
  #nodes: Words;
  #nodeWords: number;
  #brickCount = 0;
  #attributeCount = 0;
  #hasFull = false;

  /**
   * parts: a container, or those of a grid's first tiles, in order. channel: colours the grid if it
   * has it. preview: the same mesh in larger cells, whose voxels are drawn as full bricks in place
   * of the tiles that follow. inner: the colour of voxels that have none, else the mean of the
   * others. Throws a DecodeError, also for grids of more words than TABLE_WORDS_MAX.
   */
  constructor(
    parts: readonly Uint8Array[],
    private readonly channel: Channel | null = null,
    private readonly preview: Uint8Array | undefined = undefined,
    private readonly inner: Vec3 | null = null,
  ) {
    const opened = parts.map(openContainer),
      tiles = opened.flatMap((part) => part.tiles);
    const voxelCount = opened.reduce((sum, part) => sum + part.voxelCount, 0);
    this.#container = { ...opened[0]!, tiles, voxelCount };
    const { dims } = this.#container;
    const bricks = tiles.reduce((sum, tile) => sum + tile.brickCount, 0);
    needWords("bricks", bricks * BRICK_WORDS);
    const side = (cells: number): number => Math.ceil(cells / 256);
    this.#tileDims = [side(dims[0]), side(dims[1]), side(dims[2])];
    this.#nodeWords = this.#tileDims[0] * this.#tileDims[1] * this.#tileDims[2];
    this.#nodes = tableOf(this.#nodeWords);
    this.#bricks = tableOf(bricks * BRICK_WORDS);
    this.#masks = bytesOf(this.#bricks);
    this.#rows = new Rows(dims);
  }

  /** Packs; pauses after each part of the work. */
  *run(): Generator<void, PackedGrid> {
    for (const entry of this.#container.tiles) {
      this.#addTile(entry);
      yield;
    }
    if (this.preview) {
      this.#addPreview(openContainer(this.preview));
      yield;
    }
    needWords("voxels with attributes", this.#attributeCount);
    const attributes = this.#makeAttributes();
    let first = 0;
    for (const tile of this.#tiles) {
      for (let i = 0; i < tile.entry.streams.length; ++i) {
        this.#addChannel(attributes, i, tile, first);
        yield;
      }
      first += tile.attributeVoxels;
    }
    markEmptyCubes(this.#nodes, 0, this.#tileDims, 8);
    yield;
    return this.#finished(attributes);
  }

  #finished(attributes: Attributes): PackedGrid {
    const { dims, channels } = this.#container,
      count = this.#attributeCount;
    const shown = channelIn(this.#container, this.channel) ?? ownChannel(channels);
    const values = { attributes, attributeCount: count, inner: this.#innerColor(attributes.color) };
    const paint = shown === null ? null : paintOf(values, shown);
    const isEmpty = this.#low[0]! >= this.#high[0]!;
    const occupiedMin: Vec3 = isEmpty ? [0, 0, 0] : (this.#low as unknown as Vec3);
    const occupiedMax: Vec3 = isEmpty ? dims : (this.#high as unknown as Vec3);
    const grid: PackedGrid = {
      ...values,
      dims,
      channels,
      paint,
      occupiedMin,
      occupiedMax,
      origin: this.#container.origin,
      voxelSize: this.#container.voxelSize,
      voxels: this.#container.voxelCount,
      tileDims: this.#tileDims,
      nodes: this.#nodes.slice(0, tableOf(this.#nodeWords).length),
      nodeWords: this.#nodeWords,
      bricks: this.#bricks,
      brickCount: this.#brickCount,
      hull: this.#rows.points(),
    };
    if (paint) setColorMeans(grid, paint.colors);
    if (attributes.normal) setNormalMeans(grid, attributes.normal);
    return grid;
  }

  /** Voxels in full nodes and those of (0,0,0,0) have no colour. */
  #innerColor(colors: Words | undefined): Vec3 | null {
    const count = this.#attributeCount;
    if (!colors || !(this.#hasFull || colors.subarray(0, count).includes(0))) return null;
    return this.inner ?? (count > 0 ? meanOfAll(colors, count) : null);
  }

  /** Makes room for so many words at the end of the nodes and returns where. */
  #grow(words: number): number {
    const at = this.#nodeWords;
    this.#nodeWords += words;
    if (this.#nodeWords > this.#nodes.length) {
      needWords("table entries", this.#nodeWords);
      const larger = tableOf(2 * this.#nodes.length);
      larger.set(this.#nodes);
      this.#nodes = larger;
    }
    return at;
  }

  #growBox(x: number, y: number, z: number, side: number): void {
    const low = this.#low,
      high = this.#high;
    low[0] = Math.min(low[0]!, x);
    low[1] = Math.min(low[1]!, y);
    low[2] = Math.min(low[2]!, z);
    const { dims } = this.#container;
    high[0] = Math.min(dims[0], Math.max(high[0]!, x + side));
    high[1] = Math.min(dims[1], Math.max(high[1]!, y + side));
    high[2] = Math.min(dims[2], Math.max(high[2]!, z + side));
  }

  /** Grows the box by the voxels of a brick. A brick inside the box costs nothing. */
  #growByMask(x: number, y: number, z: number, at: number): void {
    const low = this.#low,
      high = this.#high;
    if (
      x >= low[0]! &&
      y >= low[1]! &&
      z >= low[2]! &&
      x + 8 <= high[0]! &&
      y + 8 <= high[1]! &&
      z + 8 <= high[2]!
    ) {
      return;
    }
    for (let i = 0; i < 512; ++i) {
      if (((this.#masks[at + (i >> 3)]! >> (i & 7)) & 1) === 0) continue;
      this.#growBox(x + compact(i), y + compact(i >> 1), z + compact(i >> 2), 1);
    }
  }

  #addTile(entry: TileEntry): void {
    const { dims, channels } = this.#container;
    const octree = new Octree(decompressStream(entry.octree, OCTREE_BYTES_MAX));
    if (octree.bricks !== entry.brickCount || octree.voxels !== entry.voxelCount) {
      brokenGrid(
        entry.offset,
        "octree does not match its directory entry",
        `${entry.brickCount} bricks and ${entry.voxelCount} voxels`,
        `${octree.bricks} and ${octree.voxels}`,
      );
    }
    const full: FullNode[] = [],
      firstByte = 4 * BRICK_WORDS * this.#brickCount;
    const codes = octree.read(this.#masks, firstByte, 4 * BRICK_WORDS, full);
    checkFullNodes(full);
    if (channels.length === 0) checkMasks(this.#masks, firstByte, 4 * BRICK_WORDS, codes.length);
    const base = cornerOf(entry.coord);
    this.#checkCells(base, codes, firstByte, full, dims);
    this.#tiles.push({ entry, attributeVoxels: octree.maskVoxels });
    this.#hasFull ||= full.length > 0;
    for (const node of full) this.#rows.addFull(node, base);
    const place = this.#placeOf(entry.coord);
    if (full.length > 0 && full[0]!.level === TILE_LEVELS) {
      this.#nodes[place] = FULL;
      this.#growBox(base[0], base[1], base[2], 256);
      return;
    }
    const table = this.#grow(TILE_ENTRIES);
    this.#nodes[place] = CHILD | table;
    for (const node of full) this.#addFull(node, base, table);
    for (let i = 0; i < codes.length; ++i) this.#addBrick(codes[i]!, base, table);
    this.#markEmpty(table);
  }

  /** Marks the empty parts of a tile whose voxels are all there. */
  #markEmpty(table: number): void {
    for (let i = 0; i < TILE_ENTRIES; ++i) {
      const block = this.#nodes[table + i]!;
      if ((block & CHILD) !== 0) markEmptyCubes(this.#nodes, block & ~CHILD, [4, 4, 4], 3);
    }
    markEmptyCubes(this.#nodes, table, [8, 8, 8], 5);
  }

  /** Fills bricks of the tiles that follow. */
  #addPreview(preview: Container): void {
    const { dims, origin, voxelSize, tiles } = this.#container,
      last = tiles.at(-1);
    const done = last ? mortonOf(...last.coord) : -1,
      tables = new Map<number, number>(); // of places
    const fill = (cell: Vec3, side: number): void => {
      const bricks = (c: number, end: 0 | 1): number =>
        (preview.origin[c]! + preview.voxelSize[c]! * (cell[c]! + end * side) - origin[c]!) /
        (8 * voxelSize[c]!);
      const low = (c: number): number => Math.max(0, Math.floor(bricks(c, 0) + SLACK));
      const high = (c: number): number =>
        Math.min(Math.ceil(dims[c]! / 8), Math.ceil(bricks(c, 1) - SLACK));
      for (let z = low(2); z < high(2); ++z) {
        for (let y = low(1); y < high(1); ++y) {
          for (let x = low(0); x < high(0); ++x) {
            const coord: Vec3 = [x >> 5, y >> 5, z >> 5];
            if (mortonOf(...coord) <= done) continue;
            const place = this.#placeOf(coord),
              table = tables.get(place) ?? this.#grow(TILE_ENTRIES);
            tables.set(place, table);
            this.#nodes[place] = CHILD | table;
            const node = { code: mortonOf(x & 31, y & 31, z & 31), level: 0 },
              base = cornerOf(coord);
            this.#addFull(node, base, table);
            this.#rows.addFull(node, base);
          }
        }
      }
    };
    for (const { coord, octree: stream } of preview.tiles) {
      const octree = new Octree(decompressStream(stream, OCTREE_BYTES_MAX)),
        base = cornerOf(coord);
      const full: FullNode[] = [],
        masks = new Uint8Array(64 * octree.bricks);
      const cornerIn = (code: number, side: number): Vec3 => [
        base[0] + side * compact(code),
        base[1] + side * compact(code >> 1),
        base[2] + side * compact(code >> 2),
      ];
      octree.read(masks, 0, 64, full).forEach((code, b) => {
        for (let i = 0; i < 512; ++i) {
          if (((masks[64 * b + (i >> 3)]! >> (i & 7)) & 1) !== 0) {
            fill(cornerIn(512 * code + i, 1), 1);
          }
        }
      });
      for (const { code, level } of full) fill(cornerIn(code, 8), 8 << level);
    }
    this.#hasFull ||= tables.size > 0;
    for (const table of tables.values()) this.#markEmpty(table);
  }

  #placeOf(coord: Vec3): number {
    return coord[0] + this.#tileDims[0] * (coord[1] + this.#tileDims[1] * coord[2]);
  }

  /** Refuses voxels outside dims. */
  #checkCells(
    base: Vec3,
    codes: Uint32Array,
    firstByte: number,
    full: readonly FullNode[],
    dims: Vec3,
  ): void {
    const fits = (code: number, bricks: number): boolean =>
      base[0] + 8 * (compact(code) + bricks) <= dims[0] &&
      base[1] + 8 * (compact(code >> 1) + bricks) <= dims[1] &&
      base[2] + 8 * (compact(code >> 2) + bricks) <= dims[2];
    if (fits(0, 32)) return;
    let inside = full.every((node) => fits(node.code, 1 << node.level));
    for (let b = 0; b < codes.length && inside; ++b) {
      const code = codes[b]!;
      if (fits(code, 1)) continue;
      const mask = firstByte + 4 * BRICK_WORDS * b;
      for (let i = 0; i < 512; ++i) {
        if (((this.#masks[mask + (i >> 3)]! >> (i & 7)) & 1) === 0) continue;
        inside &&=
          base[0] + 8 * compact(code) + compact(i) < dims[0] &&
          base[1] + 8 * compact(code >> 1) + compact(i >> 1) < dims[1] &&
          base[2] + 8 * compact(code >> 2) + compact(i >> 2) < dims[2];
      }
    }
    if (!inside) brokenGrid(0, "a tile has voxels outside dims");
  }

  /** The place of a brick's entry. Its block gets a table if it has none. */
  #brickEntry(table: number, x: number, y: number, z: number): number {
    const block = table + (x >> 2) + 8 * (y >> 2) + 64 * (z >> 2);
    if (this.#nodes[block] === 0) {
      const at = this.#grow(BLOCK_WORDS);
      this.#nodes[block] = CHILD | at;
    }
    return (this.#nodes[block]! & ~CHILD) + (x & 3) + 4 * (y & 3) + 16 * (z & 3);
  }

  /** Marks a full node, at the largest parts of the tree that it covers. */
  #addFull(node: FullNode, base: Vec3, table: number): void {
    const x = compact(node.code),
      y = compact(node.code >> 1),
      z = compact(node.code >> 2);
    const side = 1 << node.level,
      step = side < 4 ? 1 : 4;
    this.#growBox(base[0] + 8 * x, base[1] + 8 * y, base[2] + 8 * z, 8 * side);
    for (let c = 0; c < side; c += step) {
      for (let b = 0; b < side; b += step) {
        for (let a = 0; a < side; a += step) {
          const at =
            step === 1
              ? this.#brickEntry(table, x + a, y + b, z + c)
              : table + ((x + a) >> 2) + 8 * ((y + b) >> 2) + 64 * ((z + c) >> 2);
          this.#nodes[at] = FULL;
        }
      }
    }
  }

  #addBrick(code: number, base: Vec3, table: number): void {
    const x = compact(code),
      y = compact(code >> 1),
      z = compact(code >> 2);
    const word = BRICK_WORDS * this.#brickCount,
      byte = 4 * word,
      bricks = this.#bricks;
    const cx = base[0] + 8 * x,
      cy = base[1] + 8 * y,
      cz = base[2] + 8 * z;
    this.#growByMask(cx, cy, cz, byte);
    this.#rows.addBrick(cx, cy, cz, this.#masks, byte);
    const at = this.#brickEntry(table, x, y, z);
    this.#nodes[at] = CHILD | this.#brickCount++;
    bricks[word + BRICK_FIRST] = this.#attributeCount;
    let nodes = 0;
    for (let i = 0; i < 8; ++i) {
      const low = bricks[word + 2 * i]!,
        high = bricks[word + 2 * i + 1]!;
      if ((low | high) !== 0) nodes |= 1 << i;
      this.#attributeCount += bitCount(low) + bitCount(high);
    }
    bricks[word + BRICK_NODES] = nodes;
  }

  #makeAttributes(): Attributes {
    const count = this.#attributeCount,
      attributes: Attributes = {};
    for (const channel of this.#container.channels) {
      if (channel === "color" || channel === "normal") attributes[channel] = tableOf(count);
      else if (channel === "distance") attributes.distance = new Int16Array(count);
      else if (channel === "coverage") attributes.coverage = new Uint8Array(count);
      else attributes[channel] = new Uint16Array(count);
    }
    return attributes;
  }

  /** Reads a channel's stream of a tile into the values from voxel `first` on. */
  #addChannel(attributes: Attributes, index: number, tile: OpenTile, first: number): void {
    const name = this.#container.channels[index]!,
      stream = tile.entry.streams[index]!;
    if (stream.length === 0) return;
    const planes = CHANNELS.find((channel) => channel.name === name)!.planes;
    const voxels = tile.attributeVoxels,
      expected = planes * voxels;
    const raw = decompressStream(stream, expected);
    if (raw.length !== expected) {
      fail("grid container, attributes: their bytes", String(expected), String(raw.length));
    }
    const values = attributes[name]!,
      stride = values.BYTES_PER_ELEMENT;
    const bytes = new Uint8Array(values.buffer);
    for (let plane = 0; plane < planes; ++plane) {
      let sample = 0;
      for (
        let i = plane * voxels, at = first * stride + plane;
        i < (plane + 1) * voxels;
        ++i, at += stride
      ) {
        sample = (sample + raw[i]!) & 255;
        bytes[at] = sample;
      }
    }
  }
}

/** Packs at once. Throws a DecodeError. */
export function packGrid(bytes: Uint8Array): PackedGrid {
  const steps = new Packer([bytes]).run();
  for (;;) {
    const step = steps.next();
    if (step.done) return step.value;
  }
}
