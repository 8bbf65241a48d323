// PNG of RGBA pixels. A canvas would premultiply them, which loses colours of transparent pixels.

const CRC_TABLE = new Int32Array(256);
for (let i = 0; i < 256; ++i) {
  let crc = i;
  for (let bit = 0; bit < 8; ++bit) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  CRC_TABLE[i] = crc;
}

function crcOf(bytes: Uint8Array): number {
  let crc = -1;
  for (let i = 0; i < bytes.length; ++i) crc = (crc >>> 8) ^ CRC_TABLE[(crc ^ bytes[i]!) & 255]!;
  return ~crc >>> 0;
}

function chunkOf(name: string, data: Uint8Array): Uint8Array<ArrayBuffer> {
  const chunk = new Uint8Array(12 + data.length),
    view = new DataView(chunk.buffer);
  view.setUint32(0, data.length);
  for (let i = 0; i < 4; ++i) chunk[4 + i] = name.charCodeAt(i);
  chunk.set(data, 8);
  view.setUint32(8 + data.length, crcOf(chunk.subarray(4, 8 + data.length)));
  return chunk;
}

async function deflated(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** A PNG of pixels whose lowest row is first: 8 bits, sRGB, straight alpha. */
export async function encodePng(pixels: Uint8Array, width: number, height: number): Promise<Blob> {
  const stride = 4 * width,
    rows = new Uint8Array((stride + 1) * height);
  for (let y = 0; y < height; ++y) {
    const from = (height - 1 - y) * stride,
      to = y * (stride + 1);
    rows[to] = y === 0 ? 0 : 2; // each row as the difference to the one above
    for (let i = 0; i < stride; ++i) {
      rows[to + 1 + i] = pixels[from + i]! - (y === 0 ? 0 : pixels[from + stride + i]!);
    }
  }
  const head = new Uint8Array(13),
    view = new DataView(head.buffer);
  view.setUint32(0, width);
  view.setUint32(4, height);
  head.set([8, 6, 0, 0, 0], 8);
  const signature = new Uint8Array([137, 80, 78, 71, 13, 10, 26, 10]);
  return new Blob(
    [
      signature,
      chunkOf("IHDR", head),
      chunkOf("sRGB", new Uint8Array(1)),
      chunkOf("IDAT", await deflated(rows)),
      chunkOf("IEND", new Uint8Array(0)),
    ],
    { type: "image/png" },
  );
}
