// node compress.mjs FROM TO KIND: writes a glTF file anew with glTF-Transform, compressed by draco-edgebreaker,
// draco-sequential, meshopt or meshopt-filters.
import { Logger, NodeIO } from "@gltf-transform/core";
import { ALL_EXTENSIONS, EXTMeshoptCompression, KHRDracoMeshCompression } from "@gltf-transform/extensions";
import draco3d from "draco3dgltf";
import { MeshoptDecoder, MeshoptEncoder } from "meshoptimizer";

const [from, to, kind] = process.argv.slice(2);
const { EncoderMethod: Draco } = KHRDracoMeshCompression;
const { EncoderMethod: Meshopt } = EXTMeshoptCompression;
const [extension, options] = {
  "draco-edgebreaker": [KHRDracoMeshCompression, { method: Draco.EDGEBREAKER }],
  "draco-sequential": [KHRDracoMeshCompression, { method: Draco.SEQUENTIAL, quantizationBits: { POSITION: 16 } }],
  meshopt: [EXTMeshoptCompression, { method: Meshopt.QUANTIZE }],
  "meshopt-filters": [EXTMeshoptCompression, { method: Meshopt.FILTER }],
}[kind];
await MeshoptEncoder.ready;
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  "draco3d.decoder": await draco3d.createDecoderModule(),
  "draco3d.encoder": await draco3d.createEncoderModule(),
  "meshopt.decoder": MeshoptDecoder,
  "meshopt.encoder": MeshoptEncoder,
});
const document = await io.read(from);
document.setLogger(new Logger(Logger.Verbosity.ERROR));
document.createExtension(extension).setRequired(true).setEncoderOptions(options);
await io.write(to, document);
