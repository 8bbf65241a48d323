// One stream of codec fast: a single zstd frame (RFC 8878) with its content size.
import { decompress } from "../../third_party/fzstd/fzstd";
import { fail } from "./decode_error";
import { xxHash64Low } from "./xxhash64";

const MAGIC = 0xfd2fb528;
const BLOCK_BYTES_MAX = 1 << 17;

function broken(detail: string): never {
  fail(`grid container, stream: ${detail}`);
}

interface Frame {
  readonly contentBytes: bigint;
  readonly blocks: number; // where the first block begins
  readonly hasChecksum: boolean;
}

function readHead(bytes: Uint8Array, view: DataView): Frame {
  if (bytes.length < 5) broken("the zstd frame is cut off");
  if (view.getUint32(0, true) !== MAGIC) broken("not a zstd frame");
  const descriptor = bytes[4]!;
  if ((descriptor & 8) !== 0) broken("reserved bit of the zstd frame");
  const isSingle = (descriptor & 32) !== 0,
    sizeCode = descriptor >> 6;
  const dictionaryBytes = [0, 1, 2, 4][descriptor & 3]!;
  const sizeBytes = sizeCode === 0 ? (isSingle ? 1 : 0) : 1 << sizeCode;
  const sizeAt = 5 + (isSingle ? 0 : 1) + dictionaryBytes;
  if (bytes.length < sizeAt + sizeBytes) broken("the zstd frame is cut off");
  for (let i = sizeAt - dictionaryBytes; i < sizeAt; ++i) {
    if (bytes[i] !== 0) broken("the zstd frame needs a dictionary");
  }
  if (sizeBytes === 0) broken("the zstd frame does not say its size");
  let contentBytes = 0n;
  for (let i = sizeBytes; i-- > 0;)
    contentBytes = (contentBytes << 8n) | BigInt(bytes[sizeAt + i]!);
  if (sizeCode === 1) contentBytes += 256n;
  return { contentBytes, blocks: sizeAt + sizeBytes, hasChecksum: (descriptor & 4) !== 0 };
}

/** Where the frame's last block ends. */
function endOfBlocks(bytes: Uint8Array, first: number): number {
  let at = first;
  for (let isLast = false; !isLast;) {
    if (at + 3 > bytes.length) broken("the zstd frame is cut off");
    const head = bytes[at]! | (bytes[at + 1]! << 8) | (bytes[at + 2]! << 16);
    const kind = (head >> 1) & 3,
      size = head >> 3;
    if (kind === 3 || size > BLOCK_BYTES_MAX) broken("a block of the zstd frame is invalid");
    isLast = (head & 1) !== 0;
    at += 3 + (kind === 1 ? 1 : size);
    if (at > bytes.length) broken("the zstd frame is cut off");
  }
  return at;
}

function contentsOf(bytes: Uint8Array, contentBytes: number): Uint8Array {
  try {
    // Without a buffer fzstd allocates the frame's window, which may be gigabytes.
    return decompress(bytes, new Uint8Array(contentBytes));
  } catch (error) {
    return broken(error instanceof Error ? error.message : String(error));
  }
}

/**
 * The contents of a stream. Throws a DecodeError if they are more than rawBytesMax, and for every
 * malformed, longer or shorter frame. Takes memory and time in proportion to the stream and to the
 * contents.
 */
export function decompressStream(bytes: Uint8Array, rawBytesMax: number): Uint8Array {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const frame = readHead(bytes, view);
  const blocksEnd = endOfBlocks(bytes, frame.blocks);
  const end = blocksEnd + (frame.hasChecksum ? 4 : 0);
  if (end > bytes.length) broken("the zstd frame is cut off");
  if (end < bytes.length) broken("bytes after the zstd frame");
  if (frame.contentBytes > BigInt(rawBytesMax)) {
    broken(`expected at most ${rawBytesMax} bytes, got ${frame.contentBytes}`);
  }
  const raw = contentsOf(bytes, Number(frame.contentBytes));
  if (BigInt(raw.length) !== frame.contentBytes) broken("the zstd frame is shorter than it says");
  if (frame.hasChecksum && xxHash64Low(raw) !== view.getUint32(blocksEnd, true)) {
    broken("the checksum of the zstd frame differs");
  }
  return raw;
}
