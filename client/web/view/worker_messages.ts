// Messages between the viewer and its worker.
import type { PackedGrid, Paint, Words } from "./pack/packed_grid";
import type { Channel, Vec3 } from "./viewer";

/**
 * A container, or those of the first tiles of a grid, with a preview of the others (pack/packer.ts);
 * of a part, with the colour inside of the whole.
 */
export interface Encoded {
  readonly parts: readonly ArrayBuffer[];
  readonly preview?: ArrayBuffer;
  readonly inner?: Vec3 | null;
}

/** The parts of a grid that another colour changes or needs. */
export type PaintInput = Pick<
  PackedGrid,
  "attributes" | "attributeCount" | "inner" | "nodes" | "bricks" | "brickCount" | "tileDims"
>;

/** A grid's colours, with the tables that hold their means. */
export interface Painted {
  readonly paint: Paint;
  readonly nodes: Words;
  readonly bricks: Words;
}

export type Request =
  | {
      readonly kind: "decode";
      readonly id: number;
      readonly grid: Encoded;
      readonly channel: Channel | null;
    }
  | {
      readonly kind: "paint";
      readonly id: number;
      readonly channel: Channel;
      readonly grid: PaintInput;
    }
  | { readonly kind: "abort"; readonly id: number };

export type Response =
  | { readonly kind: "decoded"; readonly id: number; readonly grid: PackedGrid }
  | { readonly kind: "painted"; readonly id: number; readonly painted: Painted | null }
  | {
      readonly kind: "failed";
      readonly id: number;
      readonly name: string;
      readonly message: string;
    };

/** The buffers of typed arrays in an object, which a message may move instead of copying. */
export function buffersOf(value: unknown): ArrayBuffer[] {
  const buffers = new Set<ArrayBuffer>();
  const visit = (item: unknown): void => {
    if (ArrayBuffer.isView(item)) buffers.add(item.buffer as ArrayBuffer);
    else if (item !== null && typeof item === "object") Object.values(item).forEach(visit);
  };
  visit(value);
  return [...buffers];
}
