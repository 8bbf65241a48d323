// Malformed containers are refused, in the words of the C++ decoder.
import assert from "node:assert/strict";
import { test } from "node:test";
import { DecodeError } from "../../../client/web/view/decode/decode_error";
import { Octree } from "../../../client/web/view/decode/octree";
import { decompressStream } from "../../../client/web/view/decode/zstd_stream";
import { xxHash64Low } from "../../../client/web/view/decode/xxhash64";
import { packGrid } from "../../../client/web/view/pack/packer";
import { containerOf, listed } from "./containers";

/** The text of a refusal; empty if the bytes are taken. Other errors are thrown. */
function refusal(act: () => unknown): string {
  try {
    act();
    return "";
  } catch (error) {
    if (error instanceof DecodeError) return error.message;
    throw error;
  }
}
const refused = (bytes: Uint8Array): string => refusal(() => packGrid(bytes));

type Edit = (view: DataView, bytes: Uint8Array) => void;
function edited(edit: Edit): Uint8Array {
  const bytes = containerOf("two_tiles");
  edit(new DataView(bytes.buffer), bytes);
  return bytes;
}
const DIRECTORY = 144,
  ENTRY = 48,
  DATA = DIRECTORY + 2 * ENTRY;

test("every truncation and every extra byte is refused", () => {
  for (const { name } of listed().filter(({ changes }) => changes)) {
    const bytes = containerOf(name);
    assert.equal(refused(bytes), "", name);
    for (let size = 0; size < bytes.length; ++size) {
      assert.match(refused(bytes.slice(0, size)), /^grid container, byte /, `${name}: ${size}`);
      // A header that says the shorter length does not help.
      if (size < 128) continue;
      const cut = bytes.slice(0, size);
      new DataView(cut.buffer).setBigUint64(96, BigInt(size), true);
      assert.notEqual(refused(cut), "", `${name}: ${size}, length corrected`);
    }
    const longer = new Uint8Array(bytes.length + 1);
    longer.set(bytes);
    assert.equal(
      refused(longer),
      `grid container, byte 96: length: expected ${bytes.length} bytes, got ${longer.length}`,
    );
    new DataView(longer.buffer).setBigUint64(96, BigInt(longer.length), true);
    assert.equal(
      refused(longer),
      `grid container, byte ${bytes.length}: bytes after the last tile`,
    );
  }
  assert.equal(
    refused(new Uint8Array(0)),
    "grid container, byte 0: the header is cut off: expected 128 bytes, got 0",
  );
});

test("a changed byte is refused if and only if the C++ decoder refuses it", () => {
  let changed = 0,
    refusals = 0,
    stricter = 0;
  for (const { name, changes } of listed()) {
    for (const [at, by, text] of changes ?? []) {
      const bytes = containerOf(name);
      bytes[at]! ^= by;
      const own = refused(bytes),
        where = `${name}, byte ${at} ^ ${by}`;
      ++changed;
      // Codec small is the one thing that only C++ reads.
      if (/codec of a stream: expected fast/.test(own)) continue;
      // libzstd ignores reserved bits of a block's sequences, fzstd does not.
      if (text === "" && own === "grid container, stream: invalid zstd data" && ++stricter <= 2)
        continue;
      assert.equal(own !== "", text !== "", `${where}: got "${own}", C++ has "${text}"`);
      if (text !== "") ++refusals;
      // Texts about frames come from two zstd decoders, and C++ has no limit of its tables.
      if (/too many bricks/.test(own)) continue;
      if (!/^grid container, (stream|octree|attributes)/.test(text)) assert.equal(own, text, where);
    }
  }
  assert.ok(changed > 2000 && refusals > 1000, `${changed} changes, ${refusals} refusals`);
});

const HEADER: readonly (readonly [Edit, string])[] = [
  [(_, b) => (b[0] = 118), "0: not a grid container: expected the magic VOXGRID, got other bytes"],
  [(v) => v.setUint32(8, 2, true), "8: version: expected 3, got 2"],
  [(v) => v.setUint32(12, 67, true), "12: unknown channels"],
  [(v) => v.setInt32(16, 0, true), "16: dims: expected 1 to 16384, got 0"],
  [(v) => v.setInt32(20, 16385, true), "16: dims: expected 1 to 16384, got 16385"],
  [(v) => v.setInt32(24, -5, true), "16: dims: expected 1 to 16384, got -5"],
  [(v) => v.setUint32(28, 9, true), "28: tile side: expected 8, got another"],
  [(v) => v.setFloat64(32, NaN, true), "16: origin is not finite"],
  [
    (v) => v.setFloat64(56, 0, true),
    "16: voxel size: expected a finite number above 0, got 0.000000",
  ],
  [
    (v) => v.setFloat64(72, -1, true),
    "16: voxel size: expected a finite number above 0, got -1.000000",
  ],
  [
    (v) => v.setFloat64(64, Infinity, true),
    "16: voxel size: expected a finite number above 0, got inf",
  ],
  [(v) => v.setUint32(80, 0xffffffff, true), "80: meta or directory is cut off"],
  [(v) => v.setUint32(84, 0xffffffff, true), "80: meta or directory is cut off"],
  [(v) => v.setBigUint64(88, 16n, true), "88: voxel count: expected 15, got 16"],
  [(_, b) => (b[104] = 2), "104: codec of a stream: expected 0 or 1, got 2"],
  [(_, b) => (b[107] = 1), "107: codec of a stream: expected 0, got 1"],
  [(_, b) => (b[111] = 1), "111: reserved byte: expected 0, got 1"],
  [(_, b) => (b[143] = 1), "143: padding: expected 0, got 1"],
  [(v) => v.setInt32(DIRECTORY, 2, true), `${DIRECTORY}: tile coord is outside the grid`],
  [
    (v) => v.setInt32(DIRECTORY, 1, true),
    `${DIRECTORY + ENTRY}: tiles are not in ascending Morton order`,
  ],
  [
    (v) => v.setUint32(DIRECTORY + 12, 2, true),
    `${DATA}: octree does not match its directory entry: expected 2 bricks and 6 voxels, got 1 and 6`,
  ],
  [
    (v) => v.setBigUint64(DIRECTORY + 16, 1n << 40n, true),
    `${DIRECTORY + 16}: voxel count: expected 1 to 16777216, got 1099511627776`,
  ],
  [
    (v) => v.setBigUint64(DIRECTORY + 24, 0n, true),
    `${DIRECTORY + 24}: tile offset: expected ${DATA}, got 0`,
  ],
  [
    (v) => v.setUint32(DIRECTORY + 32, 0, true),
    `${DIRECTORY + 32}: streams do not match the channels`,
  ],
  [
    (v) => v.setUint32(DIRECTORY + 40, 0xffffffff, true),
    `${DIRECTORY + 24}: tile data lie beyond the end`,
  ],
  [
    (v) => v.setUint32(DIRECTORY + 44, 1, true),
    `${DIRECTORY + 44}: reserved bytes: expected 0, got others`,
  ],
  [(v) => v.setInt32(16, 258, true), "0: a tile has voxels outside dims"],
];

test("every field of header and directory is checked", () => {
  for (const [edit, text] of HEADER)
    assert.equal(refused(edited(edit)), `grid container, byte ${text}`);
});

test("attributes of another length than the voxels need are refused", () => {
  const bytes = edited((view, b) => {
    const [octree, color, normal] = [32, 36, 40].map((at) =>
      view.getUint32(DIRECTORY + at, true),
    ) as [number, number, number];
    const at = DATA + octree,
      streams = b.slice(at, at + color + normal);
    b.set(streams.subarray(color), at);
    b.set(streams.subarray(0, color), at + normal);
    view.setUint32(DIRECTORY + 36, normal, true);
    view.setUint32(DIRECTORY + 40, color, true);
  });
  assert.equal(refused(bytes), "grid container, attributes: their bytes: expected 24, got 18");
});

test("codec small is refused with the codec to ask for", () => {
  assert.equal(
    refused(containerOf("small")),
    "grid container, byte 104: codec of a stream: expected fast, which the page reads, got small",
  );
});

test("a directory of more bricks than the tables hold is refused before anything is decoded", () => {
  const bytes = edited((view) => view.setUint32(DIRECTORY + 12, 0x7fffffff, true));
  assert.match(
    refused(bytes),
    /^the grid has too many bricks to draw: expected at most 16777216, got 4\d{10}$/,
  );
});

test("octrees that are no octrees are refused", () => {
  const octree = (...bytes: number[]): string => refusal(() => new Octree(new Uint8Array(bytes)));
  assert.equal(octree(1, 1, 1, 1, 1, 1, 1, 1), "");
  assert.equal(octree(), "grid container, octree: level 0 is cut off");
  assert.equal(octree(1, 1, 1, 1, 1, 1, 1), "grid container, octree: level 7 is cut off");
  assert.equal(
    octree(1, 1, 1, 1, 1, 1, 1, 1, 1),
    "grid container, octree: bytes after the last level",
  );
  assert.equal(octree(1, 1, 1, 1, 1, 1, 0, 1), "grid container, octree: level 6 has an empty node");
  assert.equal(octree(0), "");
});

// Magic; then each test adds descriptor, size and blocks (RFC 8878).
const frame = (...bytes: number[]): Uint8Array =>
  new Uint8Array([0x28, 0xb5, 0x2f, 0xfd, ...bytes]);

test("frames that are no frames are refused", () => {
  const stream = (bytes: Uint8Array, most = 4096): string =>
    refusal(() => decompressStream(bytes, most));
  const text = (detail: string): string => `grid container, stream: ${detail}`;
  assert.equal(stream(frame(0x20, 5, 0x29, 0, 0, 1, 2, 3, 4, 5)), "");
  assert.equal(
    stream(frame(0xe0, 255, 255, 255, 255, 255, 255, 255, 15, 1, 0, 0)),
    text("expected at most 4096 bytes, got 1152921504606846975"),
  );
  assert.equal(stream(frame(0, 0, 1, 0, 0)), text("the zstd frame does not say its size"));
  assert.equal(stream(frame(0x20, 5, 1, 0, 0)), text("unexpected EOF"));
  assert.equal(
    stream(frame(0x20, 5, 0x29, 0, 0, 1, 2, 3, 4, 5, 0)),
    text("bytes after the zstd frame"),
  );
  assert.equal(
    stream(frame(0x24, 5, 0x29, 0, 0, 1, 2, 3, 4, 5, 0, 0, 0, 0)),
    text("the checksum of the zstd frame differs"),
  );
  assert.equal(stream(frame(0x20, 5, 0x07, 0, 0)), text("a block of the zstd frame is invalid"));
  assert.equal(
    stream(frame(0x21, 9, 5, 0x29, 0, 0, 1, 2, 3, 4, 5)),
    text("the zstd frame needs a dictionary"),
  );
  assert.equal(
    stream(new Uint8Array([0x50, 0x2a, 0x4d, 0x18, 0, 0, 0, 0])),
    text("not a zstd frame"),
  );
  // Runs that write past the end, and one that stops before it.
  assert.notEqual(stream(frame(0x20, 5, 0x33, 0, 0, 7)), "");
  assert.notEqual(stream(frame(0x20, 5, 0x23, 0, 0, 7)), "");
});

test("the window of a frame takes no memory", () => {
  const before = process.memoryUsage().arrayBuffers;
  // No contents in a window of 1 GiB: 2^(10 + 20) bytes.
  const bytes = frame(0x80, 20 << 3, 0, 0, 0, 0, 1, 0, 0);
  assert.equal(bytes.length, 13);
  const contents = decompressStream(bytes, 4096);
  assert.equal(contents.length, 0);
  const grown = process.memoryUsage().arrayBuffers - before;
  assert.ok(contents.buffer.byteLength === 0 && grown < 1 << 20, `${grown} bytes more`);
});

test("Huffman tables whose states take no bits are refused", () => {
  // A block of 32 literals; the weights of their Huffman code have an FSE table of one symbol.
  const bytes = frame(0x20, 32, 0x65, 0, 0, 2, 2, 2, 4, 0xf0, 3, 0, 0x80, 1, 1, 1, 0);
  assert.equal(
    refusal(() => decompressStream(bytes, 32)),
    "grid container, stream: invalid zstd data",
  );
});

test("random changes of streams end soon in a refusal", () => {
  let seed = 1;
  const random = (end: number): number =>
    (seed = (Math.imul(seed, 1103515245) + 12345) & 0x7fffffff) % end;
  for (const name of ["random_63", "random_9", "full_0"]) {
    const source = containerOf(name),
      begin = process.cpuUsage();
    const first = 128 + 8 * Math.ceil(new DataView(source.buffer).getUint32(84, true) / 8);
    const data = Number(new DataView(source.buffer).getBigUint64(first + 24, true));
    for (let i = 0; i < 300; ++i) {
      const bytes = source.slice();
      for (let k = 0; k < 3; ++k) bytes[data + random(bytes.length - data)]! ^= 1 + random(255);
      assert.notEqual(refused(bytes), "", `${name}, round ${i}`);
    }
    const { user, system } = process.cpuUsage(begin); // microseconds
    assert.ok(user + system < 100_000 * 300, name);
  }
});

test("hashes are those of the specification", () => {
  const hash = (text: string): string => xxHash64Low(new TextEncoder().encode(text)).toString(16);
  assert.equal(hash(""), "51d8e999");
  assert.equal(hash("a"), "a98c6e5b");
  assert.equal(hash("abc"), "ad770999");
});
