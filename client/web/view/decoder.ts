// The viewer's side of the worker.
import { DecodeError } from "./decode/decode_error";
import type { PackedGrid } from "./pack/packed_grid";
import type { Channel } from "./viewer";
import { type Encoded, type Painted, type PaintInput, type Request, type Response } from "./worker_messages";

interface Waiting {
  resolve(response: Response): void;
  reject(error: Error): void;
}

function errorOf(name: string, message: string): Error {
  return name === "DecodeError" ? new DecodeError(message) : new Error(message);
}

/** A later grid is shown, or the viewer is closed. */
function abortError(): Error {
  return new DOMException("", "AbortError");
}

export class Decoder {
  #worker: Worker | null; // null: the last one has failed, and the next request starts another
  readonly #waiting = new Map<number, Waiting>();
  #last = 0;
  #closed: Error | null = null;
  #decoding = 0; // number of the decode that runs, or 0

  constructor(private readonly workerUrl: string) {
    this.#worker = this.#start();
  }

  #start(): Worker {
    const worker = new Worker(this.workerUrl, { type: "module" });
    worker.onmessage = (event: MessageEvent<Response>) => this.#receive(event.data);
    worker.onerror = (event) =>
      this.#failAll(new Error(event.message || "the viewer's worker did not start"));
    worker.onmessageerror = () => this.#failAll(new Error("no memory for the worker's message"));
    return worker;
  }

  /**
   * Decodes a copy of the grid, coloured by the channel if it has it. Aborts the decode before, which
   * rejects with AbortError.
   */
  async decode(grid: Encoded, channel: Channel | null): Promise<PackedGrid> {
    this.abort();
    const id = (this.#decoding = ++this.#last);
    const response = await this.#ask({ kind: "decode", id, grid, channel });
    if (this.#decoding === id) this.#decoding = 0;
    return (response as Extract<Response, { kind: "decoded" }>).grid;
  }

  /** Colours a copy of the grid by a channel; null if it lacks the channel. */
  async paint(channel: Channel, grid: PaintInput): Promise<Painted | null> {
    const response = await this.#ask({ kind: "paint", id: ++this.#last, channel, grid });
    return (response as Extract<Response, { kind: "painted" }>).painted;
  }

  /** Aborts the decode that runs, if one does. */
  abort(): void {
    const waiting = this.#waiting.get(this.#decoding);
    if (!waiting) return;
    this.#waiting.delete(this.#decoding);
    this.#worker?.postMessage({ kind: "abort", id: this.#decoding } satisfies Request);
    waiting.reject(abortError());
  }

  dispose(): void {
    this.#failAll((this.#closed = abortError()));
  }

  #ask(request: Request): Promise<Response> {
    if (this.#closed) return Promise.reject(this.#closed);
    const worker = (this.#worker ??= this.#start());
    return new Promise((resolve, reject) => {
      this.#waiting.set(request.id, { resolve, reject });
      worker.postMessage(request);
    });
  }

  #receive(response: Response): void {
    const waiting = this.#waiting.get(response.id);
    this.#waiting.delete(response.id);
    if (!waiting) return;
    if (response.kind === "failed") waiting.reject(errorOf(response.name, response.message));
    else waiting.resolve(response);
  }

  #failAll(error: Error): void {
    this.#worker?.terminate();
    this.#worker = null;
    const all = [...this.#waiting.values()];
    this.#waiting.clear();
    for (const waiting of all) waiting.reject(error);
  }
}
