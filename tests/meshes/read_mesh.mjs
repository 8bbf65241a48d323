// Reads each .glb that a line of the input names by three programs of others, and prints what each found, as a line of
// JSON:
//   validator  Khronos' glTF validator: issues
//   three      three.js' GLTFLoader: meshes, their triangles, instances and box in world space
//   manifold   Manifold, which accepts only closed manifold meshes: volume in cells, or the reason
import fs from "node:fs";
import { createInterface } from "node:readline";
import { MeshoptDecoder } from "meshoptimizer";
import Manifold from "manifold-3d";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import validator from "gltf-validator";

globalThis.self = globalThis;
const wasm = await Manifold();
wasm.setup();

async function validate(bytes) {
  const { issues } = await validator.validateBytes(bytes);
  return issues.messages;
}

async function load(bytes) {
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const { scene } = await loader.parseAsync(buffer, "");
  scene.updateMatrixWorld(true);
  const meshes = [];
  scene.traverse((object) => {
    if (object.isMesh) meshes.push(object);
  });
  return { scene, meshes };
}

function describe({ scene, meshes }) {
  const box = new THREE.Box3().setFromObject(scene, true);
  return {
    meshes: meshes.length,
    triangles: meshes.reduce((sum, mesh) => sum + mesh.geometry.index.count / 3, 0),
    instances: meshes.reduce((sum, mesh) => sum + (mesh.isInstancedMesh ? mesh.count : 0), 0),
    instance_colors: meshes.reduce((sum, mesh) => sum + (mesh.instanceColor?.count ?? 0), 0),
    attributes: meshes.flatMap((mesh) => Object.keys(mesh.geometry.attributes)).sort(),
    min: box.min.toArray(),
    max: box.max.toArray(),
  };
}

function solidOf(meshes) {
  const { index, attributes } = meshes[0].geometry;
  const points = new Float32Array(3 * attributes.position.count);
  for (let i = 0; i < attributes.position.count; ++i) {
    points.set([attributes.position.getX(i), attributes.position.getY(i), attributes.position.getZ(i)], 3 * i);
  }
  const mesh = new wasm.Mesh({ numProp: 3, vertProperties: points, triVerts: Uint32Array.from(index.array) });
  mesh.merge(); // vertices at one place with several colours
  try {
    return { volume: new wasm.Manifold(mesh).volume() };
  } catch (error) {
    return { refused: String(error.message ?? error) };
  }
}

for await (const line of createInterface({ input: process.stdin })) {
  const bytes = new Uint8Array(fs.readFileSync(JSON.parse(line)[0]));
  const loaded = await load(bytes);
  console.log(JSON.stringify({
    validator: await validate(bytes),
    three: describe(loaded),
    manifold: loaded.meshes.length > 0 ? solidOf(loaded.meshes) : null,
  }));
}
