// XXH64 with seed 0 (Collet, "xxHash fast digest algorithm", 2012), of which a zstd frame stores
// the low 32 bits. 64-bit numbers are pairs of 32-bit halves, since BigInt is 30 times slower.

// The five primes as halves.
const P1H = 0x9e3779b1,
  P1L = 0x85ebca87;
const P2H = 0xc2b2ae3d,
  P2L = 0x27d4eb4f;
const P3H = 0x165667b1,
  P3L = 0x9e3779f9;
const P4H = 0x85ebca77,
  P4L = 0xc2b2ae63;
const P5H = 0x27d4eb2f,
  P5L = 0x165667c5;

/** The high half of the product of two unsigned 32-bit numbers. */
function highProduct(a: number, b: number): number {
  const al = a & 0xffff,
    ah = a >>> 16,
    bl = b & 0xffff,
    bh = b >>> 16;
  const low = al * bl;
  const middle = ah * bl + (low >>> 16);
  const other = al * bh + (middle & 0xffff);
  return (ah * bh + Math.floor(middle / 0x10000) + (other >>> 16)) | 0;
}

/** The state of a hash: h and l are the halves of the number that the functions below change. */
class Halves {
  h = 0;
  l = 0;

  set(h: number, l: number): void {
    this.h = h | 0;
    this.l = l | 0;
  }
  add(h: number, l: number): void {
    const low = (this.l >>> 0) + (l >>> 0);
    this.l = low | 0;
    this.h = (this.h + h + (low > 0xffffffff ? 1 : 0)) | 0;
  }
  times(h: number, l: number): void {
    const high = highProduct(this.l, l) + Math.imul(this.h, l) + Math.imul(this.l, h);
    this.l = Math.imul(this.l, l);
    this.h = high | 0;
  }
  /** Rotates left by 1 to 31 bits. */
  turn(bits: number): void {
    const h = this.h,
      l = this.l;
    this.h = (h << bits) | (l >>> (32 - bits));
    this.l = (l << bits) | (h >>> (32 - bits));
  }
  xor(h: number, l: number): void {
    this.h ^= h;
    this.l ^= l;
  }
  /** this ^= this >>> bits */
  fold(bits: number): void {
    if (bits >= 32) this.l ^= this.h >>> (bits - 32);
    else this.xor(this.h >>> bits, (this.l >>> bits) | (this.h << (32 - bits)));
  }
}

function round(state: Halves, h: number, l: number, scratch: Halves): void {
  scratch.set(h, l);
  scratch.times(P2H, P2L);
  state.add(scratch.h, scratch.l);
  state.turn(31);
  state.times(P1H, P1L);
}

function merge(hash: Halves, lane: Halves, scratch: Halves): void {
  const value = new Halves();
  round(value, lane.h, lane.l, scratch);
  hash.xor(value.h, value.l);
  hash.times(P1H, P1L);
  hash.add(P4H, P4L);
}

/** The hash of whole stripes of 32 bytes, in four lanes. */
function hashOfStripes(view: DataView, end: number, scratch: Halves): Halves {
  const lanes = [new Halves(), new Halves(), new Halves(), new Halves()] as const;
  const [a, b, , d] = lanes;
  a.set(P1H, P1L);
  a.add(P2H, P2L);
  b.set(P2H, P2L);
  d.set(~P1H, ~P1L);
  d.add(0, 1);
  for (let at = 0; at < end; at += 32) {
    for (let i = 0; i < 4; ++i) {
      const place = at + 8 * i;
      round(lanes[i]!, view.getInt32(place + 4, true), view.getInt32(place, true), scratch);
    }
  }
  const hash = new Halves();
  const turns = [1, 7, 12, 18] as const;
  for (let i = 0; i < 4; ++i) {
    const lane = lanes[i]!;
    scratch.set(lane.h, lane.l);
    scratch.turn(turns[i]!);
    hash.add(scratch.h, scratch.l);
  }
  for (const lane of lanes) merge(hash, lane, scratch);
  return hash;
}

/** The low 32 bits of XXH64, unsigned. */
export function xxHash64Low(bytes: Uint8Array): number {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const size = bytes.length,
    scratch = new Halves();
  let at = size & ~31;
  let hash = new Halves();
  if (at > 0) hash = hashOfStripes(view, at, scratch);
  else hash.set(P5H, P5L);
  hash.add(0, size);
  for (; at + 8 <= size; at += 8) {
    const word = new Halves();
    round(word, view.getInt32(at + 4, true), view.getInt32(at, true), scratch);
    hash.xor(word.h, word.l);
    hash.turn(27);
    hash.times(P1H, P1L);
    hash.add(P4H, P4L);
  }
  if (at + 4 <= size) {
    scratch.set(0, view.getInt32(at, true));
    scratch.times(P1H, P1L);
    hash.xor(scratch.h, scratch.l);
    hash.turn(23);
    hash.times(P2H, P2L);
    hash.add(P3H, P3L);
    at += 4;
  }
  for (; at < size; ++at) {
    scratch.set(0, bytes[at]!);
    scratch.times(P5H, P5L);
    hash.xor(scratch.h, scratch.l);
    hash.turn(11);
    hash.times(P1H, P1L);
  }
  hash.fold(33);
  hash.times(P2H, P2L);
  hash.fold(29);
  hash.times(P3H, P3L);
  hash.fold(32);
  return hash.l >>> 0;
}
