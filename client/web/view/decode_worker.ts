// The worker: decodes containers and colours grids, so that the page never waits. A bundle of its
// own.
import { setColorMeans } from "./pack/means";
import { Packer } from "./pack/packer";
import { paintOf } from "./pack/paint";
import type { Channel } from "./viewer";
import {
  buffersOf,
  type Encoded,
  type Painted,
  type PaintInput,
  type Request,
  type Response,
} from "./worker_messages";

// Work is done in slices, between which aborts are received.
const SLICE_MS = 15;

const scope = globalThis as unknown as {
  onmessage: ((event: MessageEvent<Request>) => void) | null;
  postMessage(message: Response, transfer: Transferable[]): void;
};
const aborted = new Set<number>();

function reply(response: Response): void {
  scope.postMessage(response, buffersOf(response));
}

function fail(id: number, error: unknown): void {
  const { name, message } = error instanceof Error ? error : new Error(String(error));
  reply({ kind: "failed", id, name, message });
}

async function decode(id: number, grid: Encoded, channel: Channel | null): Promise<void> {
  const { parts, preview, inner } = grid,
    bytesOf = (buffer: ArrayBuffer): Uint8Array => new Uint8Array(buffer);
  const packer = new Packer(parts.map(bytesOf), channel, preview && bytesOf(preview), inner),
    steps = packer.run();
  for (let begin = performance.now(); ;) {
    const step = steps.next();
    if (step.done) return reply({ kind: "decoded", id, grid: step.value });
    if (performance.now() - begin < SLICE_MS) continue;
    await new Promise((resolve) => setTimeout(resolve, 0));
    if (aborted.delete(id)) return; // nobody waits for it
    begin = performance.now();
  }
}

function painted(channel: Channel, grid: PaintInput): Painted | null {
  const paint = paintOf(grid, channel);
  if (!paint) return null;
  setColorMeans(grid, paint.colors);
  return { paint, nodes: grid.nodes, bricks: grid.bricks };
}

scope.onmessage = (event) => {
  const request = event.data;
  try {
    if (request.kind === "abort") aborted.add(request.id);
    else if (request.kind === "decode")
      decode(request.id, request.grid, request.channel).catch((error: unknown) =>
        fail(request.id, error),
      );
    else
      reply({ kind: "painted", id: request.id, painted: painted(request.channel, request.grid) });
  } catch (error) {
    fail(request.id, error);
  }
};
