// The files that voxeld_web_containers made (make_containers.cpp).
import { readFileSync } from "node:fs";
import { join } from "node:path";

const DIRECTORY = join(process.env["VIEW_TEST_DIR"]!, "containers");

/** A byte changed, by which bits, and the C++ decoder's text; empty if it takes the result. */
export type Change = readonly [at: number, by: number, text: string];

export interface Listed {
  readonly name: string;
  readonly small?: boolean; // codec small
  readonly changes?: readonly Change[];
}

export function listed(): Listed[] {
  return JSON.parse(readFileSync(join(DIRECTORY, "list.json"), "utf8")) as Listed[];
}

export function containerOf(name: string): Uint8Array {
  return new Uint8Array(readFileSync(join(DIRECTORY, `${name}.voxg`)));
}

export interface CppTables {
  readonly nodes: Uint32Array;
  readonly bricks: Uint32Array;
  readonly colors: Uint32Array;
  readonly normals: Uint32Array;
  readonly hull: Int32Array;
  readonly facts: Int32Array; // occupied_min, occupied_max, whether there is a full_color, R, G, B
  readonly luminance: number;
}

export function tablesOf(name: string): CppTables {
  const bytes = new Uint8Array(readFileSync(join(DIRECTORY, `${name}.tables`)));
  const view = new DataView(bytes.buffer);
  let at = 0;
  const next = (): ArrayBuffer => {
    const size = 4 * view.getUint32(at, true);
    at += 4 + size;
    return bytes.buffer.slice(at - size, at);
  };
  const [nodes, bricks, colors, normals] = [next(), next(), next(), next()].map(
    (b) => new Uint32Array(b),
  );
  const hull = new Int32Array(next()),
    facts = new Int32Array(next());
  return {
    nodes: nodes!,
    bricks: bricks!,
    colors: colors!,
    normals: normals!,
    hull,
    facts,
    luminance: view.getFloat64(at, true),
  };
}
