// Reads each .ktx2 that a line of the input names by two programs of others, and prints what each found, as a line of
// JSON:
//   ktx_parse  the fields of the container, its descriptor and its text values
//   three      three.js' KTX2Loader: the texture, whose texels go to the file that the line names second; or the
//              reason why it refuses it
import fs from "node:fs";
import { createInterface } from "node:readline";
import { read } from "ktx-parse";
import { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";

function describe(container) {
  const texts = {};
  for (const [key, value] of Object.entries(container.keyValue)) {
    texts[key] = typeof value === "string" ? value : new TextDecoder().decode(value).replace(/\0$/, "");
  }
  const { vkFormat, typeSize, pixelWidth, pixelHeight, pixelDepth, layerCount, faceCount } = container;
  return {
    vkFormat, typeSize, size: [pixelWidth, pixelHeight, pixelDepth], layerCount, faceCount,
    scheme: container.supercompressionScheme,
    levels: container.levels.map((level) => [level.levelData.byteLength, level.uncompressedByteLength]),
    descriptor: container.dataFormatDescriptor,
    values: texts,
  };
}

async function load(bytes, path) {
  const loader = new KTX2Loader();
  loader.workerConfig = {}; // of compressed textures, which these are not
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  try {
    const texture = await new Promise((resolve, reject) => loader.parse(buffer, resolve, reject));
    const { data, width, height, depth } = texture.image;
    fs.writeFileSync(path, new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    return { is_3d: texture.isData3DTexture === true, size: [width, height, depth], color_space: texture.colorSpace };
  } catch (error) {
    return { refused: String(error.message ?? error) };
  }
}

for await (const line of createInterface({ input: process.stdin })) {
  const [path, texels] = JSON.parse(line);
  const bytes = new Uint8Array(fs.readFileSync(path));
  console.log(JSON.stringify({ ktx_parse: describe(read(bytes)), three: await load(bytes, texels) }));
}
